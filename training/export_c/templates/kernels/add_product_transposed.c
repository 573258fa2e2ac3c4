/* y (m x n) += alpha a b^T, with a (m x k) and b (n x k), both by rows; rows of a begin `row` apart. */
static void add_product_transposed_REAL(int m, int k, int n, REAL alpha, const REAL *a, int row,
                                        const REAL *b, REAL *y)
{
    for (int i = 0; i < m; ++i)
        for (int j = 0; j < n; ++j) {
            const REAL *left = a + i * row, *right = b + j * k;
            REAL part[8] = {0, 0, 0, 0, 0, 0, 0, 0};
            REAL total = 0;
            int p = 0;
            for (; p + 8 <= k; p += 8)
                for (int q = 0; q < 8; ++q)
                    part[q] += left[p + q] * right[p + q];
            for (; p < k; ++p)
                total += left[p] * right[p];
            for (int q = 0; q < 8; ++q)
                total += part[q];
            y[i * n + j] += alpha * total;
        }
}
