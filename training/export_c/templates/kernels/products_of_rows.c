/* y (m x n) = products of two rows of x (rows of n numbers) each, by their numbers. */
static void products_of_rows_REAL(int m, int n, const int *one, const int *other, const REAL *x,
                                  REAL *y)
{
    const int wide = n - n % 4;
    for (int i = 0; i < m; ++i) {
        const REAL *left = x + one[i] * n, *right = x + other[i] * n;
        const four_REAL zero = {0};
        for (int j = 0; j < wide; j += 4)
            store_REAL(plus_product_REAL(zero, load_REAL(left + j), load_REAL(right + j)),
                       y + i * n + j);
        for (int j = wide; j < n; ++j)
            y[i * n + j] = left[j] * right[j];
    }
}
