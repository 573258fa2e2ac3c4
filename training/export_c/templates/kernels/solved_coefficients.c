/*
 * Coefficients of residuals as polynomials of one coordinate: of a system a (m x k) and monomials b
 * (k x n) of the others, in groups of the same power, which end at `ends`. c has, for each row of a,
 * a row of n numbers for each power; n is a multiple of four. Sums are formed in registers, of 32
 * columns or of four.
 */
static void solved_coefficients_REAL(int m, int k, int n, const REAL *a, const REAL *b, int groups,
                                     const int *ends, REAL *c)
{
    const int wide = n - n % 32;
    for (int row = 0; row < m * groups; ++row) {
        const int g = row % groups, first = g > 0 ? ends[g - 1] : 0, last = ends[g];
        const REAL *x = a + row / groups * k;
        for (int j = 0; j < wide; j += 32) {
            four_REAL s0 = {0}, s1 = {0}, s2 = {0}, s3 = {0}, s4 = {0}, s5 = {0}, s6 = {0}, s7 = {0};
            for (int p = first; p < last; ++p) {
                const REAL *from = b + p * n + j;
                s0 = plus_REAL(s0, x[p], load_REAL(from));
                s1 = plus_REAL(s1, x[p], load_REAL(from + 4));
                s2 = plus_REAL(s2, x[p], load_REAL(from + 8));
                s3 = plus_REAL(s3, x[p], load_REAL(from + 12));
                s4 = plus_REAL(s4, x[p], load_REAL(from + 16));
                s5 = plus_REAL(s5, x[p], load_REAL(from + 20));
                s6 = plus_REAL(s6, x[p], load_REAL(from + 24));
                s7 = plus_REAL(s7, x[p], load_REAL(from + 28));
            }
            REAL *to = c + row * n + j;
            store_REAL(s0, to);
            store_REAL(s1, to + 4);
            store_REAL(s2, to + 8);
            store_REAL(s3, to + 12);
            store_REAL(s4, to + 16);
            store_REAL(s5, to + 20);
            store_REAL(s6, to + 24);
            store_REAL(s7, to + 28);
        }
        for (int j = wide; j < n; j += 4) {
            four_REAL sum = {0};
            for (int p = first; p < last; ++p)
                sum = plus_REAL(sum, x[p], load_REAL(b + p * n + j));
            store_REAL(sum, c + row * n + j);
        }
    }
}
