/*
 * What a Gauss-Newton step in one unknown needs of residuals r = a b and their derivatives
 * r' = c d, for each of n columns: sums of r' r' and of r r', which are added to those of other
 * rows. Matrices lie by rows: a (m x k), b (k x n), c (m x l), d (l x n); n is a multiple of sixteen.
 */
static void gauss_newton_sums_REAL(int m, int k, int l, int n, const REAL *a, const REAL *b,
                                   const REAL *c, const REAL *d, REAL *squares, REAL *products)
{
    four_REAL r[8], s[8];
    for (int j = 0; j < n; j += 16) {
        four_REAL square[4], product[4];
        for (int q = 0; q < 4; ++q) {
            square[q] = load_REAL(squares + j + 4 * q);
            product[q] = load_REAL(products + j + 4 * q);
        }
        for (int i = 0; i < m - 1; i += 2) {
            rows_of_product_REAL(k, n, a + i * k, k, 1, b + j, r);
            rows_of_product_REAL(l, n, c + i * l, l, 1, d + j, s);
            for (int q = 0; q < 8; ++q) {
                square[q % 4] = plus_product_REAL(square[q % 4], s[q], s[q]);
                product[q % 4] = plus_product_REAL(product[q % 4], r[q], s[q]);
            }
        }
        if (m % 2 == 1) {
            row_of_product_REAL(k, n, a + (m - 1) * k, 1, b + j, r);
            row_of_product_REAL(l, n, c + (m - 1) * l, 1, d + j, s);
            for (int q = 0; q < 4; ++q) {
                square[q] = plus_product_REAL(square[q], s[q], s[q]);
                product[q] = plus_product_REAL(product[q], r[q], s[q]);
            }
        }
        for (int q = 0; q < 4; ++q) {
            store_REAL(square[q], squares + j + 4 * q);
            store_REAL(product[q], products + j + 4 * q);
        }
    }
}
