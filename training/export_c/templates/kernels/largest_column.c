/*
 * The place of the column with the largest sum of squares, of the n first ones of a (rows `step`
 * apart, m of them from row k on); `squares` are the sums of all.
 */
static int largest_column_REAL(int m, int n, int step, int k, const REAL *a, REAL *squares)
{
    const int wide = n - n % 16;
    int largest = 0;
    for (int j = 0; j < wide; j += 16) {
        four_REAL s0 = {0}, s1 = {0}, s2 = {0}, s3 = {0};
        for (int i = k; i < m; ++i) {
            const REAL *row = a + i * step + j;
            const four_REAL x0 = load_REAL(row), x1 = load_REAL(row + 4);
            const four_REAL x2 = load_REAL(row + 8), x3 = load_REAL(row + 12);
            s0 = plus_product_REAL(s0, x0, x0);
            s1 = plus_product_REAL(s1, x1, x1);
            s2 = plus_product_REAL(s2, x2, x2);
            s3 = plus_product_REAL(s3, x3, x3);
        }
        store_REAL(s0, squares + j);
        store_REAL(s1, squares + j + 4);
        store_REAL(s2, squares + j + 8);
        store_REAL(s3, squares + j + 12);
    }
    for (int j = wide; j < n; ++j) {
        squares[j] = 0;
        for (int i = k; i < m; ++i)
            squares[j] += a[i * step + j] * a[i * step + j];
    }
    for (int j = 1; j < n; ++j)
        largest = squares[j] > squares[largest] ? j : largest;
    return largest;
}
