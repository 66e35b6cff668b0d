/* One record through a mass with Coulomb and viscous friction, by hand: what the engine is measured against.
 * Force held over a sample, sliding by its exponential, stops placed by a logarithm. Prints seconds a record. */
#include <math.h>
#include <stdio.h>
#include <time.h>

#define SAMPLES 10000

static double force[SAMPLES], place[SAMPLES];

static void record(double mass, double level, double damping, double step)
{
    const double rate = damping / mass, full = exp(-rate * step);
    double x = 0, v = 0;
    for (int i = 0; i < SAMPLES; i++) {
        place[i] = x;
        double rest = step;
        while (rest > 0) {
            double sign = v > 0 ? 1 : v < 0 ? -1 : force[i] > level ? 1 : force[i] < -level ? -1 : 0;
            if (sign == 0)
                break; /* held */
            double steady = (force[i] - sign * level) / damping;
            double keeps = rest == step ? full : exp(-rate * rest), end = steady + (v - steady) * keeps;
            double span = rest;
            if (end * sign < 0) { /* comes to rest on the way */
                span = log((steady - v) / steady) / rate;
                keeps = steady / (steady - v);
                end = 0;
            }
            x += steady * span + (v - steady) * (1 - keeps) / rate;
            v = end;
            rest -= span;
        }
    }
}

int main(void)
{
    double best = 1e9, sum = 0;
    for (int i = 0; i < SAMPLES; i++)
        force[i] = 20 * sin(8.168 * i * 1e-3) + 8 * sin(23.25 * i * 1e-3 + 1);
    for (int k = 0; k < 300; k++) {
        clock_t begin = clock();
        for (int j = 0; j < 10; j++)
            record(2, 5, 0.5, 1e-3);
        double spent = (double)(clock() - begin) / CLOCKS_PER_SEC / 10;
        best = spent < best ? spent : best;
        sum += place[SAMPLES - 1];
    }
    printf("%.9g %.9g\n", best, sum / 300);
    return 0;
}
