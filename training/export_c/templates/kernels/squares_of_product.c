/* y (n) = sums of squares of the columns of a b, with a (m x k) and b (k x n), both by rows. */
static void squares_of_product_REAL(int m, int k, int n, const REAL *a, const REAL *b, REAL *y)
{
    for (int j = 0; j < n; j += 32) {
        const int width = n - j < 32 ? n - j : 32;
        REAL total[32] = {0};
        for (int i = 0; i < m; ++i) {
            REAL s[32] = {0};
            for (int p = 0; p < k; ++p)
                for (int q = 0; q < width; ++q)
                    s[q] += a[i * k + p] * b[p * n + j + q];
            for (int q = 0; q < width; ++q)
                total[q] += s[q] * s[q];
        }
        for (int q = 0; q < width; ++q)
            y[j + q] = total[q];
    }
}
