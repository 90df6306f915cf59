/* A mirror of several axes on springs of play operators, written by hand: the yardstick for the general kernels.
 *
 * Same arithmetic as microrad's step of such a mirror: modes, drive and springs linear over a step, predicted with the
 * springs held, springs advanced, modes corrected. Sizes are known to the compiler: -DSTATES=36 and so on.
 */
#include <math.h>
#include <stdint.h>

typedef struct {
    double diagonal[STATES], coupling[STATES], B0[ACTUATORS][STATES], B1[ACTUATORS][STATES];
    double held[SPRINGS][STATES], end[SPRINGS][STATES];
    double F[STATES][SPRINGS], C[STATES][OUTPUTS], K[SPRINGS][OUTPUTS];
    double threshold[PLAYS], weight[SPRINGS][PLAYS];
} parameters;

typedef struct {
    double x[STATES], u[ACTUATORS], z[SPRINGS], play[PLAYS][SPRINGS];
} memory;

/* drive: steps x ACTUATORS; output: steps x OUTPUTS; columns are stored one by one, so that the compiler vectorises. */
void run(const parameters *restrict p, memory *restrict m, int64_t steps, const double *drive, double *output)
{
    double x[STATES], q[SPRINGS], z[SPRINGS];
    for (int64_t k = 0; k < steps; k++) {
        const double *u = drive + k * ACTUATORS;
        for (int i = 0; i < STATES; i += 2) {
            x[i] = p->diagonal[i] * m->x[i] + p->coupling[i] * m->x[i + 1];
            x[i + 1] = p->diagonal[i + 1] * m->x[i + 1] + p->coupling[i + 1] * m->x[i];
        }
        for (int a = 0; a < ACTUATORS; a++)
            for (int i = 0; i < STATES; i++)
                x[i] += p->B0[a][i] * m->u[a] + p->B1[a][i] * u[a];
        for (int e = 0; e < SPRINGS; e++)
            for (int i = 0; i < STATES; i++)
                x[i] += p->held[e][i] * m->z[e];
        for (int e = 0; e < SPRINGS; e++)
            q[e] = z[e] = 0.0;
        for (int i = 0; i < STATES; i++)
            for (int e = 0; e < SPRINGS; e++)
                q[e] += p->F[i][e] * x[i];
        for (int j = 0; j < PLAYS; j++)
            for (int e = 0; e < SPRINGS; e++) {
                double low = q[e] - p->threshold[j], high = q[e] + p->threshold[j], play = m->play[j][e];
                play = play < low ? low : play > high ? high : play;
                m->play[j][e] = play;
                z[e] += p->weight[e][j] * play;
            }
        for (int e = 0; e < SPRINGS; e++) {
            double change = z[e] - m->z[e];
            for (int i = 0; i < STATES; i++)
                x[i] += p->end[e][i] * change;
            m->z[e] = z[e];
        }
        double *y = output + k * OUTPUTS;
        for (int o = 0; o < OUTPUTS; o++)
            y[o] = 0.0;
        for (int i = 0; i < STATES; i++) {
            m->x[i] = x[i];
            for (int o = 0; o < OUTPUTS; o++)
                y[o] += p->C[i][o] * x[i];
        }
        for (int e = 0; e < SPRINGS; e++)
            for (int o = 0; o < OUTPUTS; o++)
                y[o] += p->K[e][o] * z[e];
        for (int a = 0; a < ACTUATORS; a++)
            m->u[a] = u[a];
    }
}
