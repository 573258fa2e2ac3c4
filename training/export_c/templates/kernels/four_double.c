/* Four numbers side by side, in plain C. */
typedef struct {
    double at[4];
} four_double;

/* Four neighbours in memory. */
static inline four_double load_double(const double *x)
{
    four_double four;
    memcpy(&four, x, sizeof four);
    return four;
}

/* Write four neighbours in memory. */
static inline void store_double(four_double four, double *x)
{
    memcpy(x, &four, sizeof four);
}

/* sum + factor x */
static inline four_double plus_double(four_double sum, double factor, four_double x)
{
    for (int q = 0; q < 4; ++q)
        sum.at[q] += factor * x.at[q];
    return sum;
}

/*
 * Sixteen columns of a product a b, in four fours: of one row of a, whose k elements are `step`
 * apart. Rows of b begin n apart.
 */
static inline void row_of_product_double(int k, int n, const double *a, int step, const double *b,
                                       four_double product[4])
{
    four_double s0 = {0}, s1 = {0}, s2 = {0}, s3 = {0};
    for (int p = 0; p < k; ++p) {
        const double *from = b + p * n, x = a[p * step];
        s0 = plus_double(s0, x, load_double(from));
        s1 = plus_double(s1, x, load_double(from + 4));
        s2 = plus_double(s2, x, load_double(from + 8));
        s3 = plus_double(s3, x, load_double(from + 12));
    }
    product[0] = s0;
    product[1] = s1;
    product[2] = s2;
    product[3] = s3;
}

/* The same of two rows of a, the second `row` after the first: eight fours, in registers. */
static inline void rows_of_product_double(int k, int n, const double *a, int row, int step,
                                        const double *b, four_double product[8])
{
    four_double s0 = {0}, s1 = {0}, s2 = {0}, s3 = {0}, t0 = {0}, t1 = {0}, t2 = {0}, t3 = {0};
    for (int p = 0; p < k; ++p) {
        const double *from = b + p * n, x = a[p * step], y = a[row + p * step];
        s0 = plus_double(s0, x, load_double(from));
        s1 = plus_double(s1, x, load_double(from + 4));
        s2 = plus_double(s2, x, load_double(from + 8));
        s3 = plus_double(s3, x, load_double(from + 12));
        t0 = plus_double(t0, y, load_double(from));
        t1 = plus_double(t1, y, load_double(from + 4));
        t2 = plus_double(t2, y, load_double(from + 8));
        t3 = plus_double(t3, y, load_double(from + 12));
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
