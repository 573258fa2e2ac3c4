/*
 * y (m x n) += alpha a b, with a (m x k) and b (k x n). Element (i, p) of a is a[i * row + p * step];
 * b and y lie by rows. Sums are formed in registers: two rows of sixteen, or one row of four.
 */
static void add_product_REAL(int m, int k, int n, REAL alpha, const REAL *a, int row, int step,
                             const REAL *b, REAL *y)
{
    const int pairs = m - m % 2, wide = n - n % 16, fours = n - n % 4;
    four_REAL s[8];
    if (n == 1 && step == 1) { /* a column, whose sums are formed along the rows of a */
        add_product_transposed_REAL(m, k, 1, alpha, a, row, b, y);
        return;
    }
    for (int j = 0; j < wide; j += 16)
        for (int i = 0; i < m; i += 2) {
            const int rows = i < pairs ? 2 : 1;
            if (rows == 2)
                rows_of_product_REAL(k, n, a + i * row, row, step, b + j, s);
            else
                row_of_product_REAL(k, n, a + i * row, step, b + j, s);
            for (int r = 0; r < rows; ++r)
                for (int q = 0; q < 4; ++q) {
                    REAL *to = y + (i + r) * n + j + 4 * q;
                    store_REAL(plus_REAL(load_REAL(to), alpha, s[4 * r + q]), to);
                }
        }
    for (int i = 0; i < m; ++i) {
        for (int j = wide; j < fours; j += 4) {
            four_REAL sum = {0};
            for (int p = 0; p < k; ++p)
                sum = plus_REAL(sum, a[i * row + p * step], load_REAL(b + p * n + j));
            store_REAL(plus_REAL(load_REAL(y + i * n + j), alpha, sum), y + i * n + j);
        }
        for (int j = fours; j < n; ++j) {
            REAL sum = 0;
            for (int p = 0; p < k; ++p)
                sum += a[i * row + p * step] * b[p * n + j];
            y[i * n + j] += alpha * sum;
        }
    }
}
