/*
 * y (n) = sums of squares of residuals, polynomials of t (n) with coefficients c of m rows and so
 * many `groups`, by Horner's rule; n is a multiple of four.
 */
static void solved_squares_REAL(int m, int n, int groups, const REAL *c, const REAL *t, REAL *y)
{
    for (int j = 0; j < n; j += 4) {
        const four_REAL x = load_REAL(t + j);
        four_REAL sum = {0};
        for (int i = 0; i < m; ++i) {
            const REAL *row = c + i * groups * n + j;
            four_REAL s = load_REAL(row + (groups - 1) * n);
            for (int g = groups - 2; g >= 0; --g)
                s = plus_product_REAL(load_REAL(row + g * n), s, x);
            sum = plus_product_REAL(sum, s, s);
        }
        store_REAL(sum, y + j);
    }
}
