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
