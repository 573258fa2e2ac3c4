/*
 * y (m x n) += alpha a b, with a (m x k) and b (k x n). Element (i, p) of a is a[i * row + p * step];
 * b and y lie by rows, which are added four numbers at a time.
 */
static void add_product_REAL(int m, int k, int n, REAL alpha, const REAL *a, int row, int step,
                             const REAL *restrict b, REAL *restrict y)
{
    const int wide = n - n % 4;
    for (int i = 0; i < m; ++i, y += n)
        for (int p = 0; p < k; ++p) {
            const REAL x = alpha * a[i * row + p * step], *from = b + p * n;
            for (int j = 0; j < wide; j += 4) {
                y[j] += x * from[j];
                y[j + 1] += x * from[j + 1];
                y[j + 2] += x * from[j + 2];
                y[j + 3] += x * from[j + 3];
            }
            for (int j = wide; j < n; ++j)
                y[j] += x * from[j];
        }
}
