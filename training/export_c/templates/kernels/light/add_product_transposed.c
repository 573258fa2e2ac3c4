/* y (m x n) += alpha a b^T, with a (m x k) and b (n x k), both by rows; rows of a begin `row` apart. */
static void add_product_transposed_REAL(int m, int k, int n, REAL alpha, const REAL *a, int row,
                                        const REAL *b, REAL *y)
{
    for (int i = 0; i < m; ++i)
        for (int j = 0; j < n; ++j) {
            const REAL *left = a + i * row, *right = b + j * k;
            REAL s0 = 0, s1 = 0, s2 = 0, s3 = 0;
            int p = 0;
            for (; p + 4 <= k; p += 4) {
                s0 += left[p] * right[p];
                s1 += left[p + 1] * right[p + 1];
                s2 += left[p + 2] * right[p + 2];
                s3 += left[p + 3] * right[p + 3];
            }
            for (; p < k; ++p)
                s0 += left[p] * right[p];
            y[i * n + j] += alpha * ((s0 + s1) + (s2 + s3));
        }
}
