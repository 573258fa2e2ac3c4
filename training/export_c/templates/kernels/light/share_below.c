/*
 * The share of a weighted sample that lies below a place, with a step of width one for each of its n
 * points x: the sum of the weights times place - x, limited to 0 to 1.
 */
static REAL share_below_REAL(int n, REAL place, const REAL *x, const REAL *weight)
{
    REAL total = 0;
    for (int i = 0; i < n; ++i)
        total += weight[i] * at_most_REAL(at_least_REAL(place - x[i], 0), 1);
    return total;
}
