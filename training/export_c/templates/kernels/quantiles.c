/*
 * Quantiles (2 x q) of q deviations (q x n) of weighted samples: the distribution function on a grid
 * of multiples of `spacing` standard deviations, from `near` to `far` on both sides of the mean, is
 * inverted by linear interpolation. A sample counts in part below the multiple next above it, and
 * wholly below those further on. `cells` has room for 4 far + 6 numbers.
 */
static void quantiles_REAL(int q, int n, const REAL *deviation, const REAL *std, const REAL *weight,
                           int near, int far, REAL spacing, const REAL *probability, REAL *cells,
                           REAL *quantile)
{
    REAL *below = cells + 2 * far + 3;
    for (int k = 0; k < q; ++k) {
        const REAL unit = std[k] * spacing, most = (REAL)(2 * far);
        for (int j = 0; j < 4 * far + 6; ++j)
            cells[j] = 0;
        for (int i = 0; i < n; ++i) {
            const REAL from = deviation[k * n + i] / unit - (REAL)0.5 + (REAL)far;
            const REAL place = !(from > -1) ? -1 : from > most ? most : from;
            const int next = (int)(place + 1); /* the first multiple above it */
            below[next] += weight[i] * ((REAL)next - place);
            cells[next + 1] += weight[i];
        }
        for (int j = 1; j < 2 * far + 3; ++j)
            cells[j] += cells[j - 1];
        for (int end = 0; end < 2; ++end) {
            const int first = end > 0 ? far + near : 0, last = end > 0 ? 2 * far : far - near;
            REAL passed = (REAL)(first - far);
            for (int j = first; j < last; ++j) {
                const REAL low = cells[j] + below[j], rise = cells[j + 1] + below[j + 1] - low;
                const REAL share = (probability[end] - low) / (rise > 1e-6f ? rise : 1e-6f);
                passed += share < 0 ? 0 : share > 1 ? 1 : share;
            }
            quantile[end * q + k] = passed * unit;
        }
    }
}
