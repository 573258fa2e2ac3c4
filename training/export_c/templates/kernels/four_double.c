/* Four numbers side by side, in plain C. */
typedef struct {
    double at[4];
} four_double;

/* sum + factor x */
static inline four_double plus_double(four_double sum, double factor, four_double x)
{
    for (int q = 0; q < 4; ++q)
        sum.at[q] += factor * x.at[q];
    return sum;
}
