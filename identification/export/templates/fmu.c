{% macro access(type, count) %}
{% for verb, constant, address in [("Get", "", "&"), ("Set", "const ", "")] %}
P{{ fmi }}({{ verb }}{{ type }})(void *c, const unsigned *vr, size_t n, {{ constant }}double *value{{ count }})
{
    size_t k;
{% if count %}
    if (count != n)
        return motorid_fail(c, "all variables are scalars");
{% endif %}
    for (k = 0; k < n; k++)
        if (motorid_{{ verb | lower }}(c, vr[k], {{ address }}value[k]))
            return MOTORID_ERROR;
    return MOTORID_OK;
}
{% endfor %}
{% endmacro %}
/* FMI {{ fmi }}.0 co-simulation of the motor above.  The declarations follow the standard's C API. */

#include <stdlib.h>
#include <string.h>

#if defined(_WIN32)
#define MOTORID_EXPORT __declspec(dllexport)
#else
#define MOTORID_EXPORT
#endif

enum { MOTORID_OK = 0, MOTORID_ERROR = 3 };

/* Value references: time, inputs, starts of the simulation, outputs, states, parameters. */
enum {
    VR_TIME, VR_VOLTAGE, VR_TEMPERATURE, VR_LOAD, VR_POSITION, VR_VOLTAGE_RATE, VR_TEMPERATURE_RATE,
    VR_POSITION_RATE, VR_POSITION_GIVEN, VR_PEAK, VR_CURRENT, VR_SPEED, VR_ANGLE, VR_STATES,
    VR_PARAMETERS = VR_STATES + MOTORID_STATES, VR_END = VR_PARAMETERS + MOTORID_PARAMETERS
};

typedef void (*motorid_logger)({{ "void *, const char *, int, const char *, const char *, ..." if fmi == 2 else "void *, int, const char *, const char *" }});

typedef struct {
    motorid_motor motor;
    double input[VR_CURRENT];      /* by value reference */
    double start[MOTORID_STATES];  /* initial values that were set */
    int is_set[MOTORID_STATES];
    int is_running;
    double begin;                  /* time of the start, s */
} motorid_values_of_fmu;

typedef struct {
    motorid_values_of_fmu now;
    motorid_logger logger;
    void *environment;
} motorid_fmu;

static int motorid_fail(const motorid_fmu *fmu, const char *message)
{
    if (fmu && fmu->logger)
        fmu->logger(fmu->environment, {% if fmi == 2 %}"motor", {% endif %}MOTORID_ERROR, "logStatusError", message);
    return MOTORID_ERROR;
}

static void motorid_defaults(motorid_fmu *fmu)
{
    memset(&fmu->now, 0, sizeof fmu->now);
    motorid_init(&fmu->now.motor);
    fmu->now.input[VR_TEMPERATURE] = 25.0;
    fmu->now.input[VR_PEAK] = fmu->now.motor.peak_temperature;
}

/* Initial state: the values that were set, and for the others what they follow. */
static void motorid_begin(motorid_fmu *fmu)
{
    motorid_values_of_fmu *f = &fmu->now;
    int k;
    motorid_start(&f->motor, f->start[0], f->start[1], f->input[VR_TEMPERATURE]);
    for (k = 0; k < MOTORID_STATES; k++)
        if (f->is_set[k])
            f->motor.carry[k] = f->start[k];
    f->motor.peak_temperature = f->input[VR_PEAK];
}

static motorid_inputs motorid_inputs_at(const motorid_fmu *fmu, double from, double to)
{
    const double *u = fmu->now.input;
    motorid_inputs in;
    in.voltage = u[VR_VOLTAGE] + u[VR_VOLTAGE_RATE] * from;
    in.voltage_next = u[VR_VOLTAGE] + u[VR_VOLTAGE_RATE] * to;
    in.temperature = u[VR_TEMPERATURE] + u[VR_TEMPERATURE_RATE] * from;
    in.temperature_next = u[VR_TEMPERATURE] + u[VR_TEMPERATURE_RATE] * to;
    in.temperature_rate = u[VR_TEMPERATURE_RATE];
    in.angle = u[VR_POSITION] + u[VR_POSITION_RATE] * from;
    in.angle_next = u[VR_POSITION] + u[VR_POSITION_RATE] * to;
    in.angle_given = u[VR_POSITION_GIVEN];
    in.load_torque = u[VR_LOAD];
    return in;
}

static int motorid_get(motorid_fmu *fmu, unsigned vr, double *value)
{
    const motorid_inputs in = motorid_inputs_at(fmu, 0.0, 0.0);
    motorid_readings out;
    if (vr == VR_TIME)
        *value = fmu->now.begin + fmu->now.motor.time;
    else if (vr < VR_CURRENT)
        *value = fmu->now.input[vr];
    else if (vr < VR_STATES) {
        motorid_read(&fmu->now.motor, &in, &out);
        *value = vr == VR_CURRENT ? out.current : vr == VR_SPEED ? out.speed : out.angle;
    } else if (vr < VR_PARAMETERS)
        *value = fmu->now.motor.carry[vr - VR_STATES];
    else if (vr < VR_END)
        *value = fmu->now.motor.parameters[vr - VR_PARAMETERS];
    else
        return motorid_fail(fmu, "a value reference is not known");
    return MOTORID_OK;
}

static int motorid_set(motorid_fmu *fmu, unsigned vr, double value)
{
    motorid_values_of_fmu *f = &fmu->now;
    if (vr != VR_TIME && vr < VR_CURRENT)
        f->input[vr] = value;
    else if (vr >= VR_PARAMETERS && vr < VR_END)
        f->motor.parameters[vr - VR_PARAMETERS] = value;
    else if (vr >= VR_STATES && vr < VR_PARAMETERS && !f->is_running) {
        f->start[vr - VR_STATES] = value;
        f->is_set[vr - VR_STATES] = 1;
    } else
        return motorid_fail(fmu, "a variable cannot be set in this mode");
    if (!f->is_running)
        motorid_begin(fmu);
    return MOTORID_OK;
}

static int motorid_do_step(motorid_fmu *fmu, double size)
{
    motorid_values_of_fmu *f = &fmu->now;
    const double parts = ceil(size / MOTORID_INTERVAL - 1e-6);
    const int count = parts > 1.0 ? (int)parts : 1;
    motorid_inputs in;
    int k;
    if (!(size >= 0.0) || parts > 1e9)
        return motorid_fail(fmu, "the communication step size is negative or too large");
    if (size == 0.0)
        return MOTORID_OK;
    f->motor.interval = size / count;
{% if is_sampled %}
    if (fabs(f->motor.interval - MOTORID_INTERVAL) > 1e-6 * MOTORID_INTERVAL)
        return motorid_fail(fmu, "the communication step size is no multiple of the sample interval"
                                 " {{ interval }} s, which a delay or a mean of the model needs");
{% endif %}
    for (k = 0; k < count; k++) {
        in = motorid_inputs_at(fmu, k * f->motor.interval, (k + 1) * f->motor.interval);
        motorid_step_within(&f->motor, &in, 1e-9);
    }
    for (k = 0; k < MOTORID_STATES; k++)
        if (!isfinite(f->motor.carry[k]))
            return motorid_fail(fmu, "the simulation diverged");
    return MOTORID_OK;
}

static motorid_fmu *motorid_instance(const char *token, motorid_logger logger, void *environment)
{
    motorid_fmu *fmu = calloc(1, sizeof *fmu);
    if (!fmu)
        return NULL;
    fmu->logger = logger;
    fmu->environment = environment;
    if (!token || strcmp(token, "{{ token }}")) {
        motorid_fail(fmu, "the instantiation token is that of another FMU");
        free(fmu);
        return NULL;
    }
    motorid_defaults(fmu);
    return fmu;
}

static int motorid_save(motorid_fmu *fmu, void **state)
{
    if (!*state)
        *state = malloc(sizeof fmu->now);
    if (!*state)
        return motorid_fail(fmu, "no memory for a state");
    memcpy(*state, &fmu->now, sizeof fmu->now);
    return MOTORID_OK;
}

static int motorid_restore(motorid_fmu *fmu, const void *state)
{
    memcpy(&fmu->now, state, sizeof fmu->now);
    return MOTORID_OK;
}

#define P{{ fmi }}(name) MOTORID_EXPORT int fmi{{ fmi }}##name

/* Calls for variables of other types, of which there are none. */
#define NONE(name) P{{ fmi }}(name)(void *c, const unsigned *vr, size_t n) \
    { (void)vr; return n ? motorid_fail(c, "the FMU has no variables of this type") : MOTORID_OK; }
/* Calls that the capabilities of this FMU exclude. */
#define EXCLUDED(name) P{{ fmi }}(name)(void *c) \
    { return motorid_fail(c, "fmi{{ fmi }}" #name " is not supported"); }

MOTORID_EXPORT const char *fmi{{ fmi }}GetVersion(void) { return "{{ fmi }}.0"; }
P{{ fmi }}(SetDebugLogging)(void *c, int on, size_t n, const char *const *categories)
{ (void)c; (void)on; (void)n; (void)categories; return MOTORID_OK; }
MOTORID_EXPORT void fmi{{ fmi }}FreeInstance(void *c) { free(c); }
P{{ fmi }}(ExitInitializationMode)(void *c)
{ motorid_begin(c); ((motorid_fmu *)c)->now.is_running = 1; return MOTORID_OK; }
P{{ fmi }}(Terminate)(void *c) { (void)c; return MOTORID_OK; }
P{{ fmi }}(Reset)(void *c) { motorid_defaults(c); return MOTORID_OK; }
P{{ fmi }}(GetFMU{{ "s" if fmi == 2 else "S" }}tate)(void *c, void **state) { return motorid_save(c, state); }
P{{ fmi }}(SetFMU{{ "s" if fmi == 2 else "S" }}tate)(void *c, void *state) { return motorid_restore(c, state); }
P{{ fmi }}(FreeFMU{{ "s" if fmi == 2 else "S" }}tate)(void *c, void **state)
{ (void)c; free(*state); *state = NULL; return MOTORID_OK; }
{% if fmi == 2 %}

typedef struct {
    motorid_logger logger;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*step_finished)(void *, int);
    void *environment;
} motorid_callbacks;

MOTORID_EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
MOTORID_EXPORT void *fmi2Instantiate(const char *name, int type, const char *guid, const char *folder,
                                     const motorid_callbacks *calls, int visible, int logging)
{
    (void)name; (void)folder; (void)visible; (void)logging;
    return type == 1 ? motorid_instance(guid, calls->logger, calls->environment) : NULL;
}
P2(SetupExperiment)(void *c, int has, double tolerance, double start, int ends, double stop)
{ (void)has; (void)tolerance; (void)ends; (void)stop; ((motorid_fmu *)c)->now.begin = start; return MOTORID_OK; }
P2(EnterInitializationMode)(void *c) { motorid_begin(c); return MOTORID_OK; }
{{ access("Real", "") }}P2(SetRealInputDerivatives)(void *c, const unsigned *vr, size_t n, const int *order, const double *value)
{
    size_t k;
    for (k = 0; k < n; k++) {
        const unsigned rate = vr[k] == VR_VOLTAGE ? VR_VOLTAGE_RATE : vr[k] == VR_TEMPERATURE
            ? VR_TEMPERATURE_RATE : vr[k] == VR_POSITION ? VR_POSITION_RATE : 0;
        if (rate && order[k] == 1)
            motorid_set(c, rate, value[k]);
    }
    return MOTORID_OK;
}
P2(DoStep)(void *c, double now, double size, int keep)
{ (void)now; (void)keep; return motorid_do_step(c, size); }
NONE(GetInteger) NONE(SetInteger) NONE(GetBoolean) NONE(SetBoolean) NONE(GetString) NONE(SetString)
EXCLUDED(SerializedFMUstateSize) EXCLUDED(SerializeFMUstate) EXCLUDED(DeSerializeFMUstate)
EXCLUDED(GetDirectionalDerivative) EXCLUDED(GetRealOutputDerivatives) EXCLUDED(CancelStep)
EXCLUDED(GetStatus) EXCLUDED(GetRealStatus) EXCLUDED(GetIntegerStatus) EXCLUDED(GetBooleanStatus)
EXCLUDED(GetStringStatus)
{% else %}

#include <stdbool.h>

MOTORID_EXPORT void *fmi3InstantiateCoSimulation(
    const char *name, const char *token, const char *folder, bool visible, bool logging, bool events,
    bool early, const unsigned *intermediate, size_t count, void *environment, motorid_logger logger,
    void *update)
{
    (void)name; (void)folder; (void)visible; (void)logging; (void)events; (void)early;
    (void)intermediate; (void)count; (void)update;
    return motorid_instance(token, logger, environment);
}
MOTORID_EXPORT void *fmi3InstantiateModelExchange(void) { return NULL; }
MOTORID_EXPORT void *fmi3InstantiateScheduledExecution(void) { return NULL; }
P3(EnterInitializationMode)(void *c, bool has, double tolerance, double start, bool ends, double stop)
{
    (void)has; (void)tolerance; (void)ends; (void)stop;
    ((motorid_fmu *)c)->now.begin = start;
    motorid_begin(c);
    return MOTORID_OK;
}
{{ access("Float64", ", size_t count") }}P3(DoStep)(void *c, double now, double size, bool keep, bool *event, bool *terminate, bool *early,
           double *reached)
{
    (void)keep;
    *event = *terminate = *early = false;
    *reached = now + size;
    return motorid_do_step(c, size);
}
{% for type in ["Float32", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64", "Boolean", "String", "Binary", "Clock"] %}
NONE(Get{{ type }}) NONE(Set{{ type }})
{% endfor %}
{% for name in excluded %}
EXCLUDED({{ name }})
{% endfor %}
{% endif %}
