/* The Kalman filter of testbed/fusion/kernels/covariance.py, same arithmetic and same outputs, for fixed sizes (-DN=5 -DS=2). */
#include <math.h>
#include <string.h>

int run(double *restrict x0, double *restrict P0, const double *restrict F0, const double *restrict Q0,
        const double *restrict H0, const double *restrict R, const double *restrict Z, long n, int started,
        double *restrict out)
{
    double x[N], P[N][N], F[N][N], Q[N][N], H[S][N], work[N][N], moved[N], g[N], K[N];
    memcpy(x, x0, sizeof x), memcpy(P, P0, sizeof P), memcpy(F, F0, sizeof F), memcpy(Q, Q0, sizeof Q), memcpy(H, H0, sizeof H);
    for (long t = 0; t < n; t++) {
        if (started) {
            for (int i = 0; i < N; i++) {
                double total = 0;
                for (int j = 0; j < N; j++) total += F[i][j] * x[j];
                moved[i] = total;
            }
            memcpy(x, moved, sizeof x);
            for (int i = 0; i < N; i++) {
                for (int j = 0; j < N; j++) work[i][j] = F[i][0] * P[0][j];
                for (int k = 1; k < N; k++)
                    for (int j = 0; j < N; j++) work[i][j] += F[i][k] * P[k][j];
            }
            for (int i = 0; i < N; i++)
                for (int j = 0; j <= i; j++) {
                    double total = Q[i][j];
                    for (int k = 0; k < N; k++) total += work[i][k] * F[j][k];
                    P[i][j] = P[j][i] = total;
                }
        }
        for (int i = 0; i < S; i++) {
            double z = Z[i * n + t], e = z, spread = 0;
            double *row = out + (2 + 2 * i) * n;
            row[t] = row[n + t] = NAN;
            if (!isfinite(z)) continue;
            for (int j = 0; j < N; j++) {
                double total = 0;
                for (int k = 0; k < N; k++) total += P[j][k] * H[i][k];
                e -= H[i][j] * x[j];
                spread += H[i][j] * total;
            }
            row[t] = e;
            row[n + t] = spread + R[i];
        }
        for (int i = 0; i < S; i++) {
            double z = Z[i * n + t], e = z, C = R[i];
            if (!isfinite(z)) continue;
            started = 1;
            for (int j = 0; j < N; j++) {
                double total = 0;
                for (int k = 0; k < N; k++) total += P[j][k] * H[i][k];
                g[j] = total;
            }
            for (int j = 0; j < N; j++) e -= H[i][j] * x[j], C += H[i][j] * g[j];
            for (int j = 0; j < N; j++) K[j] = g[j] / C, x[j] += K[j] * e;
            for (int j = 0; j < N; j++)
                for (int k = 0; k < N; k++) P[j][k] -= K[j] * g[k];
            for (int j = 0; j < N; j++) {
                double total = -R[i] * K[j];
                for (int k = 0; k < N; k++) total += P[j][k] * H[i][k];
                g[j] = total;
            }
            for (int j = 0; j < N; j++)
                for (int k = 0; k <= j; k++) P[j][k] = P[k][j] = P[j][k] - g[j] * K[k];
        }
        out[t] = x[0];
        out[n + t] = sqrt(P[0][0]);
    }
    memcpy(x0, x, sizeof x), memcpy(P0, P, sizeof P);
    return started;
}
