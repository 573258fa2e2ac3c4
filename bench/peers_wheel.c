/* Equilibria of driving rigid wheels, as soilml/physics/gears/wheel.py states them, in plain C99.
 *
 * Rows are solved in blocks, all rows of a block at every step, so that a compiler can put them side
 * by side in vector registers. Secant steps in the log of the sinkage: the first ones on few points
 * along the contact, the last ones on all. */
#include <math.h>

#define BLOCK 64
#define COARSE_STEPS 4
#define FINE_STEPS 8
#define COARSE_TOLERANCE 1e-2 /* of the log of the load carried over the load */
#define FINE_TOLERANCE 1e-7
#define SMALL 1e-12 /* change of that log that gives no slope */

/* Columns of the input, (columns, count) row by row. */
enum { RADIUS, WIDTH, COHESION, FRICTION, SHEAR, N, KC, KPHI, A0, A1, SLIP, LOAD, COLUMNS };

typedef struct {
  double in[COLUMNS][BLOCK];
  double modulus[BLOCK], tangent[BLOCK]; /* Pa / m^n, and of the friction angle */
  double load[BLOCK], torque[BLOCK], pull[BLOCK], entry[BLOCK]; /* at some sinkage */
} Block;

/* Forces at a sinkage, by `points` fractions x of the way along both parts of the contact. */
static void forces(Block *restrict rows, const double *restrict sinkage, int points,
                   const double *restrict x, const double *restrict weight) {
  double front[BLOCK], rear[BLOCK], sine[BLOCK], cosine[BLOCK], travel[BLOCK], shear[BLOCK];
  for (int i = 0; i < BLOCK; i++) {
    double half = sqrt(sinkage[i] / (2.0 * rows->in[RADIUS][i])); /* its sine */
    double entry = 2.0 * asin(half);
    rows->entry[i] = entry;
    rear[i] = (rows->in[A0][i] + rows->in[A1][i] * rows->in[SLIP][i]) * entry;
    front[i] = entry - rear[i];
    sine[i] = 2.0 * half * sqrt(1.0 - half * half);
    cosine[i] = 1.0 - 2.0 * half * half;
    travel[i] = 1.0 - rows->in[SLIP][i];
    shear[i] = -rows->in[RADIUS][i] / rows->in[SHEAR][i];
    rows->load[i] = rows->torque[i] = rows->pull[i] = 0.0;
  }
  for (int k = 0; k < points; k++)
    for (int i = 0; i < BLOCK; i++) {
      /* in front of the maximum stress, measured from the entry backward */
      double angle = x[k] * front[i];
      double s = sin(0.5 * angle), c = sqrt(1.0 - s * s); /* up to pi / 4 */
      double sin_angle = 2.0 * s * c, versine = 2.0 * s * s;
      double depth = rows->in[RADIUS][i] * (sin_angle * sine[i] - versine * cosine[i]);
      double normal = rows->modulus[i] * exp(rows->in[N][i] * log(depth));
      double strength = rows->in[COHESION][i] + normal * rows->tangent[i];
      double difference = versine * sine[i] + sin_angle * cosine[i];
      double tau = strength * (1.0 - exp(shear[i] * (angle - travel[i] * difference)));
      double up = cosine[i] - versine * cosine[i] + sin_angle * sine[i];
      double ahead = sine[i] - difference;
      double share = weight[k] * front[i];
      rows->load[i] += share * (normal * up + tau * ahead);
      rows->pull[i] += share * (tau * up - normal * ahead);
      rows->torque[i] += share * tau;
      /* behind it, measured from the exit forward; the pressure is the same */
      angle = x[k] * rear[i];
      s = sin(0.5 * angle);
      c = sqrt(1.0 - s * s);
      ahead = 2.0 * s * c;
      up = 1.0 - 2.0 * s * s;
      tau = strength *
            (1.0 - exp(shear[i] * (rows->entry[i] - angle - travel[i] * (sine[i] - ahead))));
      share = weight[k] * rear[i];
      rows->load[i] += share * (normal * up + tau * ahead);
      rows->pull[i] += share * (tau * up - normal * ahead);
      rows->torque[i] += share * tau;
    }
  for (int i = 0; i < BLOCK; i++) {
    double patch = rows->in[RADIUS][i] * rows->in[WIDTH][i];
    rows->load[i] *= patch;
    rows->pull[i] *= patch;
    rows->torque[i] *= patch * rows->in[RADIUS][i];
  }
}

/* Secant steps on these points from the log of a sinkage and a slope, which are left improved. */
static void search(Block *restrict rows, int steps, double tolerance, int points, const double *x,
                   const double *weight, double *restrict log_sinkage, double *restrict slope) {
  double sinkage[BLOCK], last[BLOCK], last_ratio[BLOCK];
  for (int step = 0; step < steps; step++) {
    int open = 0;
    for (int i = 0; i < BLOCK; i++) sinkage[i] = exp(log_sinkage[i]);
    forces(rows, sinkage, points, x, weight);
    for (int i = 0; i < BLOCK; i++) {
      double ratio = log(rows->load[i] / rows->in[LOAD][i]);
      double change = ratio - (step ? last_ratio[i] : ratio);
      slope[i] = fabs(change) > SMALL ? change / (log_sinkage[i] - last[i]) : slope[i];
      last[i] = log_sinkage[i];
      last_ratio[i] = ratio;
      open += fabs(ratio) > tolerance;
      log_sinkage[i] -= ratio / slope[i];
    }
    if (!open) return;
  }
}

/* Entry angle (rad), torque (N m), drawbar pull (N) and load carried (N): out, (4, count). */
void solve(long count, const double *in, double *out, int coarse, const double *coarse_x,
           const double *coarse_weight, int points, const double *x, const double *weight) {
  for (long first = 0; first < count; first += BLOCK) {
    Block rows;
    double log_sinkage[BLOCK], slope[BLOCK];
    for (int column = 0; column < COLUMNS; column++)
      for (int i = 0; i < BLOCK; i++) { /* the last row stands in for those that are missing */
        long row = first + i < count ? first + i : count - 1;
        rows.in[column][i] = in[column * count + row];
      }
    for (int i = 0; i < BLOCK; i++) {
      double n = rows.in[N][i], radius = rows.in[RADIUS][i], width = rows.in[WIDTH][i];
      rows.modulus[i] = rows.in[KC][i] / width + rows.in[KPHI][i];
      rows.tangent[i] = tan(rows.in[FRICTION][i]);
      slope[i] = n + 0.5;
      log_sinkage[i] = log(3.0 * rows.in[LOAD][i] /
                           ((3.0 - n) * rows.modulus[i] * width * sqrt(2.0 * radius))) /
                       slope[i];
      log_sinkage[i] = fmin(log_sinkage[i], log(radius) - 0.1);
    }
    search(&rows, COARSE_STEPS, COARSE_TOLERANCE, coarse, coarse_x, coarse_weight, log_sinkage,
           slope);
    search(&rows, FINE_STEPS, FINE_TOLERANCE, points, x, weight, log_sinkage, slope);
    for (int i = 0; i < BLOCK && first + i < count; i++) {
      out[first + i] = rows.entry[i];
      out[count + first + i] = rows.torque[i];
      out[2 * count + first + i] = rows.pull[i];
      out[3 * count + first + i] = rows.load[i];
    }
  }
}
