/*
 * y (n) = sums of squares of the columns of a b, with a (m x k) and b (k x n), both by rows. Of full
 * blocks of 32 columns, four rows of sums are formed side by side, as vector instructions do.
 */
static void squares_of_product_REAL(int m, int k, int n, const REAL *a, const REAL *b, REAL *y)
{
    int j = 0;
    for (; j + 32 <= n; j += 32) {
        REAL total[32] = {0};
        int i = 0;
        for (; i + 4 <= m; i += 4) {
            REAL s[4][32] = {{0}};
            for (int p = 0; p < k; ++p) {
                const REAL *left = a + i * k + p, *right = b + p * n + j;
                for (int r = 0; r < 4; ++r)
                    for (int q = 0; q < 32; ++q)
                        s[r][q] += left[r * k] * right[q];
            }
            for (int r = 0; r < 4; ++r)
                for (int q = 0; q < 32; ++q)
                    total[q] += s[r][q] * s[r][q];
        }
        for (; i < m; ++i) {
            REAL s[32] = {0};
            for (int p = 0; p < k; ++p)
                for (int q = 0; q < 32; ++q)
                    s[q] += a[i * k + p] * b[p * n + j + q];
            for (int q = 0; q < 32; ++q)
                total[q] += s[q] * s[q];
        }
        for (int q = 0; q < 32; ++q)
            y[j + q] = total[q];
    }
    for (; j < n; ++j) {
        y[j] = 0;
        for (int i = 0; i < m; ++i) {
            REAL s = 0;
            for (int p = 0; p < k; ++p)
                s += a[i * k + p] * b[p * n + j];
            y[j] += s * s;
        }
    }
}
