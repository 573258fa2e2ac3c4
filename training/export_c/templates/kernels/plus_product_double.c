/* sum + x y */
static inline four_double plus_product_double(four_double sum, four_double x, four_double y)
{
    for (int q = 0; q < 4; ++q)
        sum.at[q] += y.at[q] * x.at[q];
    return sum;
}
