/*
 * y (n) = sums of the rows of a (m x n, rows `step` apart), times numbers x that are as far apart:
 * sixteen columns at a time, in registers.
 */
static void sum_of_rows_REAL(int m, int n, int step, const REAL *x, const REAL *a, REAL *y)
{
    const int wide = n - n % 16, fours = n - n % 4;
    for (int j = 0; j < wide; j += 16) {
        four_REAL s[4];
        row_of_product_REAL(m, step, x, step, a + j, s);
        for (int q = 0; q < 4; ++q)
            store_REAL(s[q], y + j + 4 * q);
    }
    for (int j = wide; j < fours; j += 4) {
        four_REAL sum = {0};
        for (int i = 0; i < m; ++i)
            sum = plus_REAL(sum, x[i * step], load_REAL(a + i * step + j));
        store_REAL(sum, y + j);
    }
    for (int j = fours; j < n; ++j) {
        y[j] = 0;
        for (int i = 0; i < m; ++i)
            y[j] += x[i * step] * a[i * step + j];
    }
}
