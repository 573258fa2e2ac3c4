/*
 * y (m x n) += alpha a b, with a (m x k) and b (k x n). Element (i, p) of a is a[i * row + p * step];
 * b and y lie by rows. Eight sums are formed in registers, two rows of four.
 */
static void add_product_REAL(int m, int k, int n, REAL alpha, const REAL *a, int row, int step,
                             const REAL *b, REAL *y)
{
    int i = 0;
    for (; i + 2 <= m; i += 2) {
        int j = 0;
        for (; j + 4 <= n; j += 4) {
            const REAL *up = a + i * row, *down = up + row, *right = b + j;
            REAL s0 = 0, s1 = 0, s2 = 0, s3 = 0, t0 = 0, t1 = 0, t2 = 0, t3 = 0;
            for (int p = 0; p < k; ++p) {
                const REAL u = *up, v = *down;
                s0 += u * right[0];
                t0 += v * right[0];
                s1 += u * right[1];
                t1 += v * right[1];
                s2 += u * right[2];
                t2 += v * right[2];
                s3 += u * right[3];
                t3 += v * right[3];
                up += step;
                down += step;
                right += n;
            }
            REAL *const first = y + i * n + j, *const second = first + n;
            first[0] += alpha * s0;
            first[1] += alpha * s1;
            first[2] += alpha * s2;
            first[3] += alpha * s3;
            second[0] += alpha * t0;
            second[1] += alpha * t1;
            second[2] += alpha * t2;
            second[3] += alpha * t3;
        }
        for (; j < n; ++j) {
            const REAL *up = a + i * row, *down = up + row, *right = b + j;
            REAL s = 0, t = 0;
            for (int p = 0; p < k; ++p) {
                s += *up * *right;
                t += *down * *right;
                up += step;
                down += step;
                right += n;
            }
            y[i * n + j] += alpha * s;
            y[(i + 1) * n + j] += alpha * t;
        }
    }
    for (; i < m; ++i)
        for (int j = 0; j < n; ++j) {
            const REAL *up = a + i * row, *right = b + j;
            REAL s = 0;
            for (int p = 0; p < k; ++p) {
                s += *up * *right;
                up += step;
                right += n;
            }
            y[i * n + j] += alpha * s;
        }
}
