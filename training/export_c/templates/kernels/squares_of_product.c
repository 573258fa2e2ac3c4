/* y (n) = sums of squares of the columns of a b, with a (m x k) and b (k x n), both by rows. */
static void squares_of_product_REAL(int m, int k, int n, const REAL *a, const REAL *b, REAL *y)
{
    const int wide = n - n % 16;
    four_REAL s[8];
    for (int j = 0; j < wide; j += 16) {
        four_REAL sum[4] = {{0}};
        for (int i = 0; i < m - 1; i += 2) {
            rows_of_product_REAL(k, n, a + i * k, k, 1, b + j, s);
            for (int q = 0; q < 8; ++q)
                sum[q % 4] = plus_product_REAL(sum[q % 4], s[q], s[q]);
        }
        if (m % 2 == 1) {
            row_of_product_REAL(k, n, a + (m - 1) * k, 1, b + j, s);
            for (int q = 0; q < 4; ++q)
                sum[q] = plus_product_REAL(sum[q], s[q], s[q]);
        }
        for (int q = 0; q < 4; ++q)
            store_REAL(sum[q], y + j + 4 * q);
    }
    for (int j = wide; j < n; ++j) {
        y[j] = 0;
        for (int i = 0; i < m; ++i) {
            REAL sum = 0;
            for (int p = 0; p < k; ++p)
                sum += a[i * k + p] * b[p * n + j];
            y[j] += sum * sum;
        }
    }
}
