/* Four neighbours in memory. */
static inline four_REAL load_REAL(const REAL *x)
{
    four_REAL four;
    memcpy(&four, x, sizeof four);
    return four;
}

/* Write four neighbours in memory. */
static inline void store_REAL(four_REAL four, REAL *x)
{
    memcpy(x, &four, sizeof four);
}

/*
 * Sixteen columns of a product a b, in four fours: of one row of a, whose k elements are `step`
 * apart. Rows of b begin n apart.
 */
static inline void row_of_product_REAL(int k, int n, const REAL *a, int step, const REAL *b,
                                       four_REAL product[4])
{
    four_REAL s0 = {0}, s1 = {0}, s2 = {0}, s3 = {0};
    for (int p = 0; p < k; ++p) {
        const REAL *from = b + p * n, x = a[p * step];
        s0 = plus_REAL(s0, x, load_REAL(from));
        s1 = plus_REAL(s1, x, load_REAL(from + 4));
        s2 = plus_REAL(s2, x, load_REAL(from + 8));
        s3 = plus_REAL(s3, x, load_REAL(from + 12));
    }
    product[0] = s0;
    product[1] = s1;
    product[2] = s2;
    product[3] = s3;
}

/* The same of two rows of a, the second `row` after the first: eight fours, in registers. */
static inline void rows_of_product_REAL(int k, int n, const REAL *a, int row, int step,
                                        const REAL *b, four_REAL product[8])
{
    four_REAL s0 = {0}, s1 = {0}, s2 = {0}, s3 = {0}, t0 = {0}, t1 = {0}, t2 = {0}, t3 = {0};
    for (int p = 0; p < k; ++p) {
        const REAL *from = b + p * n, x = a[p * step], y = a[row + p * step];
        s0 = plus_REAL(s0, x, load_REAL(from));
        s1 = plus_REAL(s1, x, load_REAL(from + 4));
        s2 = plus_REAL(s2, x, load_REAL(from + 8));
        s3 = plus_REAL(s3, x, load_REAL(from + 12));
        t0 = plus_REAL(t0, y, load_REAL(from));
        t1 = plus_REAL(t1, y, load_REAL(from + 4));
        t2 = plus_REAL(t2, y, load_REAL(from + 8));
        t3 = plus_REAL(t3, y, load_REAL(from + 12));
    }
    product[0] = s0;
    product[1] = s1;
    product[2] = s2;
    product[3] = s3;
    product[4] = t0;
    product[5] = t1;
    product[6] = t2;
    product[7] = t3;
}

/*
 * y (n) = sums of the rows of a (m x n, rows `step` apart), times numbers x that are as far apart:
 * sixteen columns at a time, in registers.
 */
static inline void sum_of_rows_REAL(int m, int n, int step, const REAL *x, const REAL *a, REAL *y)
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
