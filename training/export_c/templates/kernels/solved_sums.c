/*
 * What a Gauss-Newton step needs of residuals r, polynomials of t (n) with coefficients c of m rows
 * and so many `groups`, by Horner's rule: sums of r' r' and of r r', which are added to those of
 * other rows. n is a multiple of four.
 */
static void solved_sums_REAL(int m, int n, int groups, const REAL *c, const REAL *t,
                             REAL *squares, REAL *products)
{
    for (int j = 0; j < n; j += 4) {
        const four_REAL x = load_REAL(t + j);
        four_REAL square = load_REAL(squares + j), product = load_REAL(products + j);
        for (int i = 0; i < m; ++i) {
            const REAL *row = c + i * groups * n + j;
            four_REAL r = load_REAL(row + (groups - 1) * n), s = {0};
            for (int g = groups - 2; g >= 0; --g) {
                s = plus_product_REAL(r, s, x);
                r = plus_product_REAL(load_REAL(row + g * n), r, x);
            }
            square = plus_product_REAL(square, s, s);
            product = plus_product_REAL(product, r, s);
        }
        store_REAL(square, squares + j);
        store_REAL(product, products + j);
    }
}
