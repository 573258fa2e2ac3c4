/*
 * Residuals r (m x n), polynomials of t (n) with coefficients c of m rows and so many `groups`, by
 * Horner's rule; n is a multiple of four.
 */
static void solved_values_REAL(int m, int n, int groups, const REAL *c, const REAL *t, REAL *r)
{
    for (int j = 0; j < n; j += 4) {
        const four_REAL x = load_REAL(t + j);
        for (int i = 0; i < m; ++i) {
            const REAL *row = c + i * groups * n + j;
            four_REAL s = load_REAL(row + (groups - 1) * n);
            for (int g = groups - 2; g >= 0; --g)
                s = plus_product_REAL(load_REAL(row + g * n), s, x);
            store_REAL(s, r + i * n + j);
        }
    }
}
