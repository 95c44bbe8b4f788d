/* Brushed DC motor identified by motorid {{ version }}: fixed-step simulation in C99.

{% for line in header %}   {{ line }}
{% endfor %}
   The file needs the C library's <math.h> only: no dynamic memory, no global variables that change,
   so several motors may run side by side.  Compile it as it is; for the declarations alone, define
   MOTORID_DECLARATIONS before including it.

       motorid_motor motor;
       motorid_inputs in = {0};
       motorid_readings out;
       motorid_init(&motor);
       motorid_start(&motor, 0.0, 0.0, 25.0);         current A, speed rad/s, temperature degC
       for (;;) {
           in.voltage = in.voltage_next = 6.0;        applied from now to the next sample
           in.temperature = in.temperature_next = 25.0;
           motorid_read(&motor, &in, &out);           out.current, out.speed, out.angle
           motorid_step(&motor, &in);                 advances by motor.interval
       }

   motorid_step takes motor.substeps equal substeps, so its time is bounded.  Largest error for a
   square wave and a sine of voltage, over the range of the signal:

{% for count, error in errors %}       {{ "%4d" | format(count) }} substeps    {{ "%.1e" | format(error) }}
{% endfor %}
   motorid_step_within doubles the substeps until the step is converged: for a computer that has the
   time, as in the FMU.
*/
#ifndef MOTORID_MOTOR
#define MOTORID_MOTOR

#define MOTORID_STATES {{ states | length }}
#define MOTORID_CARRY {{ carry }}
#define MOTORID_PARAMETERS {{ parameters | length }}
#ifndef MOTORID_SUBSTEPS
#define MOTORID_SUBSTEPS {{ substeps }}
#endif
#define MOTORID_INTERVAL {{ interval }} /* s */

typedef struct {
    double voltage, voltage_next;          /* V, at this sample and at the next one */
    double temperature, temperature_next;  /* degC */
    double temperature_rate;               /* K/s, for effects that depend on it */
    double angle, angle_next;              /* rad, used if angle_given is 1 */
    double angle_given;                    /* 1 to use the angle above, 0 to simulate it */
    double load_torque;                    /* N m, against positive speed */
} motorid_inputs;

typedef struct {
    double current, speed; /* A, rad/s, as the sensors of the bench would log them */
    double angle;          /* rad */
} motorid_readings;

typedef struct {
    double carry[MOTORID_CARRY];           /* the states, then the history of delayed channels */
    double parameters[MOTORID_PARAMETERS]; /* in the order of the list below */
    double time;                           /* s since the start */
    double peak_temperature;               /* degC, highest so far */
    double interval;                       /* s */
    int substeps;
} motorid_motor;

/* States:
{% for name in states %}   {{ loop.index0 }}  {{ name }}
{% endfor %}
   Parameters:
{% for parameter, value in parameters %}   {{ loop.index0 }}  {{ parameter.name }} [{{ parameter.unit }}]: {{ parameter.meaning }}
{% endfor %}*/

void motorid_init(motorid_motor *motor);
void motorid_start(motorid_motor *motor, double current, double speed, double temperature);
void motorid_read(const motorid_motor *motor, const motorid_inputs *in, motorid_readings *out);
void motorid_step(motorid_motor *motor, const motorid_inputs *in);
void motorid_step_within(motorid_motor *motor, const motorid_inputs *in, double tolerance);

#endif

#ifndef MOTORID_DECLARATIONS
#include <math.h>

static const double motorid_values[MOTORID_PARAMETERS] = {
{% for parameter, value in parameters %}    {{ value }}, /* {{ parameter.name }} [{{ parameter.unit }}] */
{% endfor %}};

/* Range of current [A] and speed [rad/s] in the training runs. */
static const double motorid_range[2] = { {{- span[0] }}, {{ span[1] -}} };

static void motorid_advance(const double *x, const double *u, const double *p, double *y)
{
{{ advance }}
}

static void motorid_sensors(const double *x, const double *u, const double *p, double *y)
{
    (void)x; (void)u; (void)p;
{{ sensors }}
}

static void motorid_fill(const motorid_motor *m, const motorid_inputs *in, int k, int n, double *u)
{
    const double from = (double)k / n, to = (double)(k + 1) / n;
    u[0] = m->interval / n;
{% if held == "foh" %}    u[1] = in->voltage + (in->voltage_next - in->voltage) * from;
    u[2] = in->voltage + (in->voltage_next - in->voltage) * to;
{% else %}    u[1] = in->voltage;
    u[2] = in->voltage_next;
{% endif %}    u[3] = in->temperature + (in->temperature_next - in->temperature) * from;
    u[4] = in->temperature + (in->temperature_next - in->temperature) * to;
    u[5] = in->angle + (in->angle_next - in->angle) * from;
    u[6] = in->angle + (in->angle_next - in->angle) * to;
    u[7] = m->time + m->interval * from;
    u[8] = 0.0;
    u[9] = fmax(m->peak_temperature, in->temperature);
    u[10] = k;
    u[11] = n;
    u[12] = in->temperature_rate;
}

static void motorid_constants(const motorid_motor *m, const motorid_inputs *in, double *p)
{
    int k;
    for (k = 0; k < MOTORID_PARAMETERS; k++)
        p[k] = m->parameters[k];
    p[MOTORID_PARAMETERS] = in->load_torque;
    p[MOTORID_PARAMETERS + 1] = in->angle_given;
}

static void motorid_substeps(const motorid_motor *m, const motorid_inputs *in, int n, double *carry)
{
    double u[13], p[MOTORID_PARAMETERS + 2], y[MOTORID_CARRY];
    int j, k;
    motorid_constants(m, in, p);
    for (j = 0; j < MOTORID_CARRY; j++)
        carry[j] = m->carry[j];
    for (k = 0; k < n; k++) {
        motorid_fill(m, in, k, n, u);
        motorid_advance(carry, u, p, y);
        for (j = 0; j < MOTORID_CARRY; j++)
            carry[j] = y[j];
    }
}

static void motorid_accept(motorid_motor *m, const motorid_inputs *in, const double *carry)
{
    int j;
    for (j = 0; j < MOTORID_CARRY; j++)
        m->carry[j] = carry[j];
    m->peak_temperature = fmax(m->peak_temperature, in->temperature);
    m->time += m->interval;
}

void motorid_init(motorid_motor *m)
{
    int k;
    for (k = 0; k < MOTORID_PARAMETERS; k++)
        m->parameters[k] = motorid_values[k];
    m->interval = MOTORID_INTERVAL;
    m->substeps = MOTORID_SUBSTEPS;
    m->peak_temperature = {{ peak }};
    m->time = 0.0;
    motorid_start(m, 0.0, 0.0, 25.0);
}

void motorid_start(motorid_motor *m, double current, double speed, double temperature)
{
    const double zero = 0.0;
    (void)temperature; (void)zero;
    m->time = 0.0;
{% for start in starts %}    m->carry[{{ loop.index0 }}] = {{ start }};
{% endfor %}}

void motorid_read(const motorid_motor *m, const motorid_inputs *in, motorid_readings *out)
{
    double u[13], p[MOTORID_PARAMETERS + 2], y[2];
    motorid_constants(m, in, p);
    motorid_fill(m, in, 0, m->substeps, u);
    motorid_sensors(m->carry, u, p, y);
    out->current = y[0];
    out->speed = y[1];
    out->angle = in->angle_given != 0.0 ? in->angle : m->carry[MOTORID_STATES - 1];
}

void motorid_step(motorid_motor *m, const motorid_inputs *in)
{
    double carry[MOTORID_CARRY];
    motorid_substeps(m, in, m->substeps, carry);
    motorid_accept(m, in, carry);
}

void motorid_step_within(motorid_motor *m, const motorid_inputs *in, double tolerance)
{
    double coarse[MOTORID_CARRY], fine[MOTORID_CARRY];
    int n, k, is_close;
    motorid_substeps(m, in, 1, coarse);
    for (n = 2; n <= 8192; n *= 2) {
        motorid_substeps(m, in, n, fine);
        is_close = 1;
        for (k = 0; k < 2; k++)
            is_close = is_close && fabs(fine[k] - coarse[k]) <= tolerance * motorid_range[k];
        if (is_close)
            break;
        for (k = 0; k < MOTORID_CARRY; k++)
            coarse[k] = fine[k];
    }
    motorid_accept(m, in, fine);
}
#endif
