/* One axis of the sampled loop, written by hand: the yardstick for the general kernel.
 *
 * Same arithmetic as microrad's kernel for one axis, one actuator and one Bouc-Wen element in cascade: PID with filtered
 * derivative and anti-windup, converters, delay, Eq. 4 feedforward, first-order amplifier with slew limit, exact
 * hysteresis step, modal linear part with u and z linear over the step.
 */
#include <math.h>
#include <stdint.h>

#define MODES 5

typedef struct {
    double step_s, d1, d2, epsilon, delta, alpha, beta, rate_limit, bias, gamma, eta;
    double diagonal[MODES], coupling[MODES], held[MODES], end[MODES], output[MODES];
    double proportional_step, integral_step, derivative_gain, filter_keep, windup_integral, windup_filter;
    double command_min, command_max, drive_resolution, sensor_resolution;
    double amplifier_factor, slew_step;
    int64_t steps_per_sample, delay_steps, feedforward;
} parameters;

typedef struct {
    int64_t clamped, saturated, slew_limited, inverse_clamped;
} counters;

static inline double relaxed(double h, double forcing, double decay)
{
    if (fabs(decay) < 0.05) { /* (1 - exp(-d)) / d as its Taylor series: expm1 costs twice */
        double d = decay, d2 = d * d;
        double low = (1.0 - d * (1.0 / 2.0)) + d2 * (1.0 / 6.0 - d * (1.0 / 24.0));
        double high = (1.0 / 120.0 - d * (1.0 / 720.0)) + d2 * (1.0 / 5040.0 - d * (1.0 / 40320.0));
        return h + (forcing - decay * h) * (low + d2 * d2 * high);
    }
    return h + (forcing - decay * h) * (1.0 - exp(-decay)) / decay;
}

static inline double hysteresis_step(const parameters *p, double h, double travel, double rate)
{
    double forcing = p->epsilon * exp(p->delta * fabs(rate)) * travel;
    double side = (h > 0.0 || (h == 0.0 && forcing > 0.0)) ? 1.0 : -1.0;
    double decay = (p->alpha + side * p->gamma) * fabs(travel) + (side * p->beta + p->eta) * travel;
    double end = relaxed(h, forcing, decay);
    if (h * forcing >= 0.0 || h * end > 0.0)
        return end;
    double fraction = decay == 0.0 ? -h / forcing : log1p(-decay * h / forcing) / decay;
    double rest = fmax(0.0, 1.0 - fraction);
    double other = (p->alpha - side * p->gamma) * fabs(travel) + (p->eta - side * p->beta) * travel;
    return relaxed(0.0, forcing * rest, other * rest);
}

static inline double clamp(double value, double limit)
{
    return value > limit ? limit : value < -limit ? -limit : value;
}

static inline double quantised(double value, double resolution)
{
    return resolution > 0.0 ? floor(value / resolution + 0.5) * resolution : value;
}

/* pending: ring of delay_steps + 1 commands, zero at rest. */
void closed_loop(const parameters *p, int64_t samples, const double *reference, double *pending, double *output,
                 double *command_out, double *drive_out, counters *count)
{
    double x[MODES] = {0}, h = 0.0, z = 0.0, q = 0.0, u = 0.0, integral = 0.0, filtered = 0.0, inverse_h = 0.0;
    double target = 0.0, sample_s = p->step_s * (double)p->steps_per_sample;
    int64_t position = 0, length = p->delay_steps + 1;
    for (int64_t k = 0; k < samples; k++) {
        double y = 0.0;
        for (int i = 0; i < MODES; i++)
            y += p->output[i] * x[i];
        double error = reference[k] - quantised(y, p->sensor_resolution);
        double feedforward = 0.0;
        if (p->feedforward) {
            double travel = (reference[k] - target) / p->d1, rate = travel / sample_s;
            if (fabs(rate) > p->rate_limit) {
                count->inverse_clamped++;
                rate = clamp(rate, p->rate_limit);
            }
            inverse_h = hysteresis_step(p, inverse_h, travel, rate);
            feedforward = (reference[k] - inverse_h + p->d1 * p->bias) / (p->d1 * exp(-p->d2 * rate)) - p->bias;
            target = reference[k];
        }
        double v = feedforward + integral - p->derivative_gain * filtered + p->proportional_step * error;
        double clipped = fmin(fmax(v, p->command_min), p->command_max);
        integral += p->integral_step * error;
        filtered = p->filter_keep * filtered + (1.0 - p->filter_keep) * error;
        if (clipped != v) {
            count->saturated++;
            integral += p->windup_integral * (clipped - v);
            filtered += p->windup_filter * (clipped - v);
        }
        double command = quantised(clipped, p->drive_resolution);
        output[k] = y;
        command_out[k] = command;
        drive_out[k] = u;
        for (int64_t m = 0; m < p->steps_per_sample; m++) {
            pending[position] = command;
            int64_t due = position - p->delay_steps;
            if (due < 0)
                due += length;
            double move = (pending[due] - u) * p->amplifier_factor;
            if (fabs(move) > p->slew_step) {
                count->slew_limited++;
                move = clamp(move, p->slew_step);
            }
            u += move;
            double travel = u - q, rate = travel / p->step_s;
            if (fabs(rate) > p->rate_limit) {
                count->clamped++;
                rate = clamp(rate, p->rate_limit);
            }
            h = hysteresis_step(p, h, travel, rate);
            double z_next = p->d1 * exp(-p->d2 * rate) * (u + p->bias) - p->d1 * p->bias + h;
            double next[MODES];
            for (int i = 0; i < MODES; i++) {
                int partner = i == 0 ? 1 : i == 1 ? 0 : i; /* the first two modes are the complex pair */
                next[i] = p->diagonal[i] * x[i] + p->coupling[i] * x[partner] + p->held[i] * z
                          + p->end[i] * (z_next - z);
            }
            for (int i = 0; i < MODES; i++)
                x[i] = next[i];
            z = z_next;
            q = u;
            position = position + 1 == length ? 0 : position + 1;
        }
    }
}
