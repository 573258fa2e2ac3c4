/*
 * Four numbers side by side, as vector instructions take them: extensions of GCC and clang, which
 * any processor can compute; plain C for other compilers.
 */
#if defined(__GNUC__)
typedef float four_float __attribute__((vector_size(16)));
#else
typedef struct {
    float at[4];
} four_float;
#endif

/* Four neighbours in memory. */
static inline four_float load_float(const float *x)
{
    four_float four;
    memcpy(&four, x, sizeof four);
    return four;
}

/* Write four neighbours in memory. */
static inline void store_float(four_float four, float *x)
{
    memcpy(x, &four, sizeof four);
}

/* sum + factor x */
static inline four_float plus_float(four_float sum, float factor, four_float x)
{
#if defined(__GNUC__)
    return sum + factor * x;
#else
    for (int q = 0; q < 4; ++q)
        sum.at[q] += factor * x.at[q];
    return sum;
#endif
}

/*
 * Sixteen columns of a product a b, in four fours: of one row of a, whose k elements are `step`
 * apart. Rows of b begin n apart.
 */
static inline void row_of_product_float(int k, int n, const float *a, int step, const float *b,
                                       four_float product[4])
{
    four_float s0 = {0}, s1 = {0}, s2 = {0}, s3 = {0};
    for (int p = 0; p < k; ++p) {
        const float *from = b + p * n, x = a[p * step];
        s0 = plus_float(s0, x, load_float(from));
        s1 = plus_float(s1, x, load_float(from + 4));
        s2 = plus_float(s2, x, load_float(from + 8));
        s3 = plus_float(s3, x, load_float(from + 12));
    }
    product[0] = s0;
    product[1] = s1;
    product[2] = s2;
    product[3] = s3;
}

/* The same of two rows of a, the second `row` after the first: eight fours, in registers. */
static inline void rows_of_product_float(int k, int n, const float *a, int row, int step,
                                        const float *b, four_float product[8])
{
    four_float s0 = {0}, s1 = {0}, s2 = {0}, s3 = {0}, t0 = {0}, t1 = {0}, t2 = {0}, t3 = {0};
    for (int p = 0; p < k; ++p) {
        const float *from = b + p * n, x = a[p * step], y = a[row + p * step];
        s0 = plus_float(s0, x, load_float(from));
        s1 = plus_float(s1, x, load_float(from + 4));
        s2 = plus_float(s2, x, load_float(from + 8));
        s3 = plus_float(s3, x, load_float(from + 12));
        t0 = plus_float(t0, y, load_float(from));
        t1 = plus_float(t1, y, load_float(from + 4));
        t2 = plus_float(t2, y, load_float(from + 8));
        t3 = plus_float(t3, y, load_float(from + 12));
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
