/* The product of n elements. */
static REAL product_of_REAL(const REAL *x, int n)
{
    REAL total = 1;
    for (int i = 0; i < n; ++i)
        total *= x[i];
    return total;
}
