/*
 * Coefficients of residuals as polynomials of one coordinate: of a system a (m x k) and monomials b
 * (k x n) of the others, in groups of the same power, which end at `ends`. The columns of a that
 * belong to rows of b are `column`. c has, for each row of a, a row of n numbers for each power; n is
 * a multiple of four. Sums are formed in registers, of two rows of sixteen, or of one row of four.
 */
static void solved_coefficients_REAL(int m, int k, int n, const REAL *a, const int *column,
                                     const REAL *b, int groups, const int *ends, REAL *c)
{
    const int wide = n - n % 16;
    for (int i = 0; i < m; i += 2) {
        const REAL *one = a + i * k, *other = i < m - 1 ? one + k : one;
        for (int j = 0; j < wide; j += 16)
            for (int g = 0, p = 0; g < groups; ++g) {
                four_REAL s0 = {0}, s1 = {0}, s2 = {0}, s3 = {0};
                four_REAL t0 = {0}, t1 = {0}, t2 = {0}, t3 = {0};
                for (; p < ends[g]; ++p) {
                    const REAL *from = b + p * n + j, x = one[column[p]], y = other[column[p]];
                    s0 = plus_REAL(s0, x, load_REAL(from));
                    s1 = plus_REAL(s1, x, load_REAL(from + 4));
                    s2 = plus_REAL(s2, x, load_REAL(from + 8));
                    s3 = plus_REAL(s3, x, load_REAL(from + 12));
                    t0 = plus_REAL(t0, y, load_REAL(from));
                    t1 = plus_REAL(t1, y, load_REAL(from + 4));
                    t2 = plus_REAL(t2, y, load_REAL(from + 8));
                    t3 = plus_REAL(t3, y, load_REAL(from + 12));
                }
                REAL *to = c + (i * groups + g) * n + j;
                store_REAL(s0, to);
                store_REAL(s1, to + 4);
                store_REAL(s2, to + 8);
                store_REAL(s3, to + 12);
                if (other == one)
                    continue;
                to += groups * n;
                store_REAL(t0, to);
                store_REAL(t1, to + 4);
                store_REAL(t2, to + 8);
                store_REAL(t3, to + 12);
            }
    }
    for (int i = 0; i < m; ++i)
        for (int j = wide; j < n; j += 4)
            for (int g = 0, p = 0; g < groups; ++g) {
                four_REAL sum = {0};
                for (; p < ends[g]; ++p)
                    sum = plus_REAL(sum, a[i * k + column[p]], load_REAL(b + p * n + j));
                store_REAL(sum, c + (i * groups + g) * n + j);
            }
}
