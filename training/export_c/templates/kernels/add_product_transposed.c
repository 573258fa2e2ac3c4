/* y (m x n) += alpha a b^T, with a (m x k) and b (n x k), both by rows; rows of a begin `row` apart. */
static void add_product_transposed_REAL(int m, int k, int n, REAL alpha, const REAL *a, int row,
                                        const REAL *b, REAL *y)
{
    const int wide = k - k % 8;
    for (int i = 0; i < m; ++i)
        for (int j = 0; j < n; ++j) {
            const REAL *left = a + i * row, *right = b + j * k;
            four_REAL s = {0}, t = {0};
            for (int p = 0; p < wide; p += 8) {
                s = plus_product_REAL(s, load_REAL(left + p), load_REAL(right + p));
                t = plus_product_REAL(t, load_REAL(left + p + 4), load_REAL(right + p + 4));
            }
            REAL part[8], total = 0;
            store_REAL(s, part);
            store_REAL(t, part + 4);
            for (int p = wide; p < k; ++p)
                total += left[p] * right[p];
            for (int q = 0; q < 8; ++q)
                total += part[q];
            y[i * n + j] += alpha * total;
        }
}
