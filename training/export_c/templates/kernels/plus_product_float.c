/* sum + x y */
static inline four_float plus_product_float(four_float sum, four_float x, four_float y)
{
#if defined(__GNUC__)
    return sum + x * y;
#else
    for (int q = 0; q < 4; ++q)
        sum.at[q] += y.at[q] * x.at[q];
    return sum;
#endif
}
