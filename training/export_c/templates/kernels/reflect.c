/*
 * Reflect the rows of a system a (m x n, rows `step` apart) from row k on, so that its column
 * `pivot` becomes zero below row k; sums of squares |a x|^2 stay. The reflection is I - v v^T / h.
 * Golub and Van Loan, Matrix Computations, section 5.1. `change` has room for n numbers.
 */
static void reflect_REAL(int m, int n, int step, int k, int pivot, REAL *a, REAL *change)
{
    const int wide = n - n % 4;
    REAL *top = a + k * step;
    REAL square = 0;
    for (int i = k; i < m; ++i)
        square += a[i * step + pivot] * a[i * step + pivot];
    if (!(square > 0))
        return;
    const REAL length = SQRT(square), first = top[pivot] < 0 ? -length : length;
    const REAL h = square + first * top[pivot];
    top[pivot] += first;
    sum_of_rows_REAL(m - k, n, step, top + pivot, top, change);
    for (int i = k; i < m; ++i) {
        REAL *row = a + i * step;
        const REAL share = -row[pivot] / h;
        for (int j = 0; j < wide; j += 4)
            store_REAL(plus_REAL(load_REAL(row + j), share, load_REAL(change + j)), row + j);
        for (int j = wide; j < n; ++j)
            row[j] += share * change[j];
        row[pivot] = i > k ? 0 : -first;
    }
}
