/*
 * y (m x n) += alpha a b, with a (m x k) and b (k x n). Element (i, p) of a is a[i * row + p * step];
 * b and y lie by rows. Blocks of 2 x 32 sums are formed side by side, as vector instructions do,
 * from a copy of 64 x 32 elements of b that stays in the first-level cache. A last odd row, and few
 * rows, which are not worth the copy, go through b directly.
 */
static void add_product_REAL(int m, int k, int n, REAL alpha, const REAL *a, int row, int step,
                             const REAL *b, REAL *y)
{
    REAL block[64 * 32];
    const int paired = m < 4 ? 0 : m - m % 2;
    for (int first = 0; paired > 0 && first < k; first += 64) {
        const int depth = k - first < 64 ? k - first : 64;
        for (int j = 0; j < n; j += 32) {
            const int width = n - j < 32 ? n - j : 32;
            for (int p = 0; p < depth; ++p) {
                const REAL *from = b + (first + p) * n + j;
                for (int q = 0; q < width; ++q)
                    block[p * 32 + q] = from[q];
                for (int q = width; q < 32; ++q)
                    block[p * 32 + q] = 0;
            }
            for (int i = 0; i < paired; i += 2) {
                REAL s[2][32] = {{0}};
                for (int p = 0; p < depth; ++p) {
                    const REAL *left = a + i * row + (first + p) * step, *right = block + p * 32;
                    for (int r = 0; r < 2; ++r)
                        for (int q = 0; q < 32; ++q)
                            s[r][q] += left[r * row] * right[q];
                }
                for (int r = 0; r < 2; ++r)
                    for (int q = 0; q < width; ++q)
                        y[(i + r) * n + j + q] += alpha * s[r][q];
            }
        }
    }
    for (int i = paired; i < m; ++i) {
        int j = 0;
        for (; j + 64 <= n; j += 64) {
            REAL s[64] = {0};
            for (int p = 0; p < k; ++p)
                for (int q = 0; q < 64; ++q)
                    s[q] += a[i * row + p * step] * b[p * n + j + q];
            for (int q = 0; q < 64; ++q)
                y[i * n + j + q] += alpha * s[q];
        }
        for (int p = 0; p < k; ++p)
            for (int q = j; q < n; ++q)
                y[i * n + q] += alpha * a[i * row + p * step] * b[p * n + q];
    }
}
