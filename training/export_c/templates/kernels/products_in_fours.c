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
