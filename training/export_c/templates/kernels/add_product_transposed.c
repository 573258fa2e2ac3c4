/* y (m x n) += alpha a b^T, with a (m x k) and b (n x k), both by rows; rows of a begin `row` apart. */
static void add_product_transposed_REAL(int m, int k, int n, REAL alpha, const REAL *a, int row,
                                        const REAL *b, REAL *y)
{
    const int wide = k - k % 8;
    for (int i = 0; i < m; ++i)
        for (int j = 0; j < n; ++j) {
            const REAL *left = a + i * row, *right = b + j * k;
            REAL s[8] = {0}, total = 0;
            for (int p = 0; p < wide; p += 8) {
                s[0] += left[p] * right[p];
                s[1] += left[p + 1] * right[p + 1];
                s[2] += left[p + 2] * right[p + 2];
                s[3] += left[p + 3] * right[p + 3];
                s[4] += left[p + 4] * right[p + 4];
                s[5] += left[p + 5] * right[p + 5];
                s[6] += left[p + 6] * right[p + 6];
                s[7] += left[p + 7] * right[p + 7];
            }
            for (int p = wide; p < k; ++p)
                total += left[p] * right[p];
            total += ((s[0] + s[1]) + (s[2] + s[3])) + ((s[4] + s[5]) + (s[6] + s[7]));
            y[i * n + j] += alpha * total;
        }
}
