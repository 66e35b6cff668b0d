/* The family of a mass with Coulomb and viscous friction by hand: 100 x 100 points, five harmonics, by the
 * closed form that ctrl_df/df/friction.py states, for one level of friction. Prints seconds a family. */
#include <complex.h>
#include <math.h>
#include <stdio.h>
#include <time.h>

#define POINTS 100
#define ORDERS 5
#define SHORT 0.5 /* arc [rad] below which its harmonics are integrated by Gauss' rule */
#define NODES 16

static double complex harmonics[POINTS][POINTS][ORDERS + 1];
static double residual[POINTS][POINTS], node[NODES], weight[NODES];

static void gauss(void)
{
    for (int i = 0; i < NODES; i++) {
        double x = cos(M_PI * (i + 0.75) / (NODES + 0.5)), slope = 1;
        for (int k = 0; k < 50; k++) {
            double p = 1, q = 0;
            for (int n = 1; n <= NODES; n++) {
                double next = ((2 * n - 1) * x * p - (n - 1) * q) / n;
                q = p, p = next;
            }
            slope = NODES * (x * p - q) / (x * x - 1);
            x -= p / slope;
        }
        node[i] = 0.5 * (x + 1), weight[i] = 1 / ((1 - x * x) * slope * slope);
    }
}

typedef struct {
    double e, s, c, sine, verse;
} response;

/* velocity a phase `s` after rest under forces 1, sin and cos - 1 */
static response responses(double beta, double s)
{
    response r;
    double x = beta * s, half = sin(0.5 * s), lost = -expm1(-x);
    r.sine = sin(s), r.verse = 2 * half * half;
    r.e = x > 1e-8 ? lost / beta : s * (1 - 0.5 * x);
    if (s >= SHORT || x >= 1) {
        r.s = (beta * r.sine + r.verse - lost) / (1 + beta * beta);
        r.c = (beta * (lost - r.verse) + r.sine) / (1 + beta * beta) - r.e;
        return r;
    }
    double sine = s, term = 0.5 * s * s;
    r.s = r.c = 0;
    for (int n = 2; n < 24; n++) {
        r.s += term, r.c -= term * s / (n + 1);
        if (fabs(term) + fabs(s * sine) < 1e-17 * r.s)
            break;
        term = ((n % 2 ? s * sine : 0) - x * term) / (n + 1);
        if (n % 2 == 0)
            sine *= -s * s / (n * (n + 1));
    }
    return r;
}

static double complex position(int k, double beta)
{
    double size = k * (k * k + beta * beta);
    return -k / size - I * beta / size;
}

static double peak(double rise, double sigma, double sine, double beta, double s)
{
    response r = responses(beta, beta < 1 ? s : 0.5 * s);
    return rise * r.e + sigma * r.c + sine * r.s;
}

static double slip(double kappa, double beta, double falls, response r, double complex *out)
{
    double x = 0.5 * M_PI * beta, ratio = x > 1e-8 ? tanh(x) / x : 1, norm = hypot(1, beta);
    double c = -kappa * 0.5 * M_PI * ratio * norm, s = -sqrt(fmax((1 - c) * (1 + c), 0));
    double cosine = (c * beta - s) / norm, sine = (s * beta + c) / norm;
    double complex turn = cosine - I * sine, square = turn * turn;
    for (int k = 1; k <= ORDERS; k += 2, turn *= square)
        out[k] = ((k == 1) + 4 * kappa / (M_PI * k) * (I * turn)) * position(k, beta);
    double rise = cosine - kappa, left = rise * r.e + cosine * r.c - sine * r.s;
    return fabs(left) / peak(rise, cosine, -sine, beta, falls - atan2(sine, cosine));
}

static double stick_slip(double kappa, double sine, double delta, double beta, double complex *out)
{
    double low = 2 * delta, high = M_PI, top = peak(0, kappa, sine, beta, low);
    double s = fmin(3 * delta, high), left = 0;
    if (beta > 0)
        s = fmin(s, low + 1 / beta);
    for (int i = 0; i < 60; i++) {
        response r = responses(beta, s);
        left = kappa * r.c + sine * r.s;
        double slope = -kappa * r.verse + sine * r.sine - beta * left;
        if (left == 0)
            break;
        if (left > 0)
            low = s;
        else
            high = s;
        double next = slope < 0 ? s - left / slope : low;
        if (!(low < next && next < high))
            next = 0.5 * (low + high);
        double moved = fabs(next - s);
        if (moved <= 4e-16 * s)
            break;
        s = next;
    }
    if (s >= SHORT) {
        double middle = 0.5 * s - delta, h = 0.5 * s;
        double complex z = cos(middle) - I * sin(middle), wide = cos(h) + I * sin(h);
        double complex before = s, power = z, width = wide;
        for (int k = 1; k <= ORDERS; k += 2) {
            double complex here = power * (2 * cimag(width) / k);
            power *= z, width *= wide;
            double complex after = power * (2 * cimag(width) / (k + 1));
            power *= z, width *= wide;
            out[k] = 2 / M_PI * (0.5 * (before + after) - kappa * here) * position(k, beta);
            before = after;
        }
        return fabs(left) / top;
    }
    int damped = beta * s >= 1;
    for (int n = 0; n < NODES; n++) {
        double phase = s * node[n], value;
        if (damped) {
            double half = sin(0.5 * phase);
            value = -kappa * 2 * half * half + sine * sin(phase);
        } else {
            response r = responses(beta, phase);
            value = kappa * r.c + sine * r.s;
        }
        value *= weight[n] * s;
        double complex turn = cos(phase) - I * sin(phase), square = turn * turn;
        for (int k = 1; k <= ORDERS; k += 2, turn *= square)
            out[k] += value * turn;
    }
    double complex turn = cos(delta) + I * sin(delta), square = turn * turn;
    for (int k = 1; k <= ORDERS; k += 2, turn *= square)
        out[k] *= 2 / M_PI * turn * (damped ? position(k, beta) : 1 / (I * k));
    return fabs(left) / top;
}

static void family(double mass, double level, double damping, const double *a, const double *omega)
{
    response half[POINTS];
    for (int j = 0; j < POINTS; j++)
        half[j] = responses(damping / (mass * omega[j]), M_PI);
    for (int i = 0; i < POINTS; i++) {
        double kappa = level / a[i], sine = sqrt((a[i] - level) / a[i] * (1 + kappa)), delta = atan2(sine, kappa);
        for (int j = 0; j < POINTS; j++) {
            double beta = damping / (mass * omega[j]), scale = 1 / (mass * omega[j]) / omega[j];
            double complex *out = harmonics[i][j];
            for (int k = 0; k <= ORDERS; k++)
                out[k] = 0;
            if (kappa * half[j].c + sine * half[j].s > 0)
                residual[i][j] = slip(kappa, beta, delta, half[j], out);
            else
                residual[i][j] = stick_slip(kappa, sine, delta, beta, out);
            for (int k = 1; k <= ORDERS; k += 2)
                out[k] *= scale;
        }
    }
}

int main(void)
{
    double a[POINTS], omega[POINTS], best = 1e9, sum = 0;
    gauss();
    for (int i = 0; i < POINTS; i++) {
        a[i] = 5.5 * pow(60 / 5.5, i / (POINTS - 1.0));
        omega[i] = 2 * pow(40 / 2.0, i / (POINTS - 1.0));
    }
    for (int k = 0; k < 40; k++) {
        clock_t begin = clock();
        for (int j = 0; j < 5; j++)
            family(9, 5, 0.5, a, omega);
        double spent = (double)(clock() - begin) / CLOCKS_PER_SEC / 5;
        best = spent < best ? spent : best;
    }
    for (int i = 0; i < POINTS; i++)
        for (int j = 0; j < POINTS; j++)
            sum += cabs(harmonics[i][j][1]) + cabs(harmonics[i][j][3]) + cabs(harmonics[i][j][5]);
    printf("%.9g %.15g\n", best, sum);
    return 0;
}
