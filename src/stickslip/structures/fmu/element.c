/* The contacts of an interface as a functional mock-up unit: FMI 2.0, co-simulation.

   Algorithm and names are those of stickslip/kernels/element.py: under a given motion
   each contact is advanced through a step independently and exactly; blocks of contacts
   without an event are advanced at once. tables.h, which the export writes, holds the
   units, the tables of the random numbers of contacts, and their initial state. */

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "tables.h"

/* ---- random numbers: Threefry-2x32 with 20 rounds, and tables of quantiles */

enum { THRESHOLD, NEWBORN, DELAY, TRACK };

static double uniform(uint32_t low, uint32_t high, uint32_t first, uint32_t second)
{
    static const int turns[2][4] = {{17, 29, 16, 24}, {13, 15, 26, 6}};
    uint32_t third = 0x1BD11BDA ^ low ^ high;
    uint32_t a = first + low;
    uint32_t b = second + high;
    for (uint32_t group = 1; group <= 5; group++) {
        for (int i = 0; i < 4; i++) {
            int by = turns[group % 2][i];
            a += b;
            b = (b << by | b >> (32 - by)) ^ a;
        }
        a += high;
        b += third + group;
        uint32_t before = low;
        low = high;
        high = third;
        third = before;
    }
    uint64_t bits = (uint64_t)a << 20 | b >> 12;
    return ((double)bits + 0.5) * 0x1p-52;
}

static double quantile(int kind, double p)
{
    int low = FIRST[kind];
    int high = FIRST[kind + 1];
    while (high - low > 1) {
        int middle = (low + high) / 2;
        if (EDGES[middle] <= p)
            low = middle;
        else
            high = middle;
    }
    double u = (p - EDGES[low]) * PIECES[low][0] - 1.0;
    double total = PIECES[low][8];
    for (int k = 7; k > 0; k--)
        total = total * u + PIECES[low][k];
    return total;
}

/* Survival function of the thresholds, used if new contacts are stretched. */
static double beyond(double x)
{
    if (x >= BEYOND_TOP)
        return 0.0;
    x = fmax(x, BEYOND_LOW);
    int cell = (int)((x - BEYOND_LOW) * BEYOND_INVERSE);
    int i = 2 * (cell < BEYOND_CELLS ? cell : BEYOND_CELLS - 1);
    if (x >= BEYOND[i + 1][0])
        i++;
    double u = (x - BEYOND[i][0]) * BEYOND[i][1];
    double total = BEYOND[i][7];
    for (int k = 6; k > 1; k--)
        total = total * u + BEYOND[i][k];
    return total;
}

/* ---- contacts, in natural units */

enum { SIZE = 32, BLOCKS = (CONTACTS + SIZE - 1) / SIZE };

typedef struct {
    double birth, threshold, until, life;
} Contact;

typedef struct {
    double stiffness, origins, squares, free, ahead, behind, until;
} Sums;

typedef struct {
    double time, carry, position, direction, slid, impulse, lost, low_key, high_key;
    double breaks, breaks_at_arrest, track, factor;
} Motion;

typedef struct {
    Motion motion;
    Sums sums;
    Sums blocks[BLOCKS];
    Contact contacts[CONTACTS];
} Memory;

/* A part of a step in which the slider does not turn round. */
typedef struct {
    double x, v, h, end, side, y, yields;
} Path;

static double way(const Path *path, double t) { return t * path->v; }

static double area(const Path *path, double t) { return 0.5 * t * t * path->v; }

static double when(const Path *path, double distance)
{
    double v = path->side * path->v;
    if (distance <= 0.0)
        return 0.0;
    return v > 0.0 ? fmin(distance / v, path->h) : path->h;
}

static double slid(const Path *path, double t)
{
    return path->y + way(path, fmin(t, path->yields));
}

static double free_impulse(const Path *path, double t)
{
    double until = fmin(t, path->yields);
    return path->y * until + area(path, until) + (t - until) * slid(path, path->h);
}

static double stiffness_of(double threshold) { return AREAS ? threshold : 1.0; }

static double wait_until(const Motion *m, double until)
{
    return fmax((until - m->time) - m->carry, 0.0);
}

static double drawn(const Motion *m, int kind, uint32_t slot, double life)
{
    uint32_t counter = 4 * (uint32_t)life + (uint32_t)kind;
    return uniform((uint32_t)m->low_key, (uint32_t)m->high_key, slot, counter);
}

static void attach(Memory *state, int slot, double place, double heading)
{
    Motion *m = &state->motion;
    Contact *contact = &state->contacts[slot];
    contact->life += 1.0;
    contact->until = -1.0;
    double x = 0.0;
    if (STRETCHED)
        x = quantile(NEWBORN, drawn(m, NEWBORN, (uint32_t)slot, contact->life));
    contact->birth = place - heading * x;
    if (KEPT)
        return;
    double p = drawn(m, THRESHOLD, (uint32_t)slot, contact->life);
    double bound = AREAS ? x * x : fabs(x);
    if (STRETCHED)
        p *= beyond(bound / m->factor);
    double threshold = fmax(m->factor * quantile(THRESHOLD, p), bound);
    contact->threshold = AREAS ? sqrt(threshold) : threshold;
}

static double delay_of(const Memory *state, int slot)
{
    if (!isnan(DELAY_TIME))
        return DELAY_TIME;
    double life = state->contacts[slot].life;
    double p = drawn(&state->motion, DELAY, (uint32_t)slot, life);
    return fmax(quantile(DELAY, p), 0.0);
}

/* Advance a contact through all its events on a path. */
static void live(Memory *state, int slot, const Path *path)
{
    Motion *m = &state->motion;
    Contact *contact = &state->contacts[slot];
    double here = 0.0;
    int held = contact->until < 0.0;
    double wait = held ? 0.0 : wait_until(m, contact->until);
    for (;; held = !held) {
        double until;
        if (held) {
            double reach = contact->birth + path->side * contact->threshold;
            double left = path->side * (contact->birth - path->x) + contact->threshold;
            int breaks = path->side != 0.0 && path->side * (reach - path->end) <= 0.0;
            until = breaks ? fmax(when(path, left), here) : path->h;
            double stretched = (path->x - contact->birth) * (until - here);
            m->impulse += stiffness_of(contact->threshold)
                * (stretched + area(path, until) - area(path, here));
            if (!breaks)
                return;
            m->breaks += 1.0;
            wait = until + delay_of(state, slot);
        } else {
            until = fmin(wait, path->h);
            if (SLIDING_FORCE > 0.0)
                m->impulse += free_impulse(path, until) - free_impulse(path, here);
            if (wait > path->h) {
                contact->until = (m->time + wait) + m->carry;
                return;
            }
            double heading = path->side != 0.0 ? path->side : m->direction;
            attach(state, slot, path->x + way(path, until), heading);
        }
        here = until;
    }
}

static void clear(Sums *sums)
{
    memset(sums, 0, sizeof *sums);
    sums->ahead = sums->until = INFINITY;
    sums->behind = -INFINITY;
}

static void count(Sums *sums, const Contact *contact)
{
    if (contact->until < 0.0) {
        double k = stiffness_of(contact->threshold);
        sums->stiffness += k;
        sums->origins += k * contact->birth;
        sums->squares += k * contact->birth * contact->birth;
        sums->ahead = fmin(sums->ahead, contact->birth + contact->threshold);
        sums->behind = fmax(sums->behind, contact->birth - contact->threshold);
    } else {
        sums->free += 1.0;
        sums->until = fmin(sums->until, contact->until);
    }
}

static void add(Sums *sums, const Sums *block)
{
    sums->stiffness += block->stiffness;
    sums->origins += block->origins;
    sums->squares += block->squares;
    sums->free += block->free;
    sums->ahead = fmin(sums->ahead, block->ahead);
    sums->behind = fmax(sums->behind, block->behind);
    sums->until = fmin(sums->until, block->until);
}

static int last_of(int block)
{
    int last = SIZE * (block + 1);
    return last < CONTACTS ? last : CONTACTS;
}

static void renew(Memory *state)
{
    clear(&state->sums);
    for (int b = 0; b < BLOCKS; b++) {
        clear(&state->blocks[b]);
        for (int slot = SIZE * b; slot < last_of(b); slot++)
            count(&state->blocks[b], &state->contacts[slot]);
        add(&state->sums, &state->blocks[b]);
    }
}

static int happens(const Motion *m, const Sums *sums, const Path *path)
{
    if (path->side > 0.0 && path->end >= sums->ahead)
        return 1;
    if (path->side < 0.0 && path->end <= sums->behind)
        return 1;
    return wait_until(m, sums->until) <= path->h;
}

/* Advance contacts that have no event on a path. */
static void pass(Motion *m, const Sums *sums, const Path *path)
{
    m->impulse += sums->stiffness * (path->x * path->h + area(path, path->h));
    m->impulse -= sums->origins * path->h;
    if (SLIDING_FORCE > 0.0)
        m->impulse += sums->free * free_impulse(path, path->h);
}

static int touches(const Memory *state, const Contact *contact, const Path *path)
{
    if (contact->until >= 0.0)
        return wait_until(&state->motion, contact->until) <= path->h;
    double reach = contact->birth + path->side * contact->threshold;
    return path->side != 0.0 && path->side * (reach - path->end) <= 0.0;
}

static void events(Memory *state, const Path *path)
{
    Motion *m = &state->motion;
    clear(&state->sums);
    for (int b = 0; b < BLOCKS; b++) {
        Sums *block = &state->blocks[b];
        if (!happens(m, block, path)) {
            pass(m, block, path);
            add(&state->sums, block);
            continue;
        }
        uint32_t touched = 0;
        int first = SIZE * b;
        clear(block);
        for (int slot = first; slot < last_of(b); slot++) {
            if (touches(state, &state->contacts[slot], path))
                touched |= (uint32_t)1 << (slot - first);
            else
                count(block, &state->contacts[slot]);
        }
        pass(m, block, path);
        for (int slot = first; slot < last_of(b); slot++) {
            if (touched >> (slot - first) & 1) {
                live(state, slot, path);
                count(block, &state->contacts[slot]);
            }
        }
        add(&state->sums, block);
    }
}

/* At an arrest of the slider, if contacts have broken since the last one: draw the
   common factor of new thresholds, and attach the contacts that wait for an arrest. */
static void arrests(Memory *state)
{
    Motion *m = &state->motion;
    if (m->breaks == m->breaks_at_arrest)
        return;
    m->breaks_at_arrest = m->breaks;
    if (TRACKS) {
        m->track += 1.0;
        m->factor = quantile(TRACK, drawn(m, TRACK, 0xFFFFFFFF, m->track));
    }
    if (!ON_ARREST)
        return;
    for (int slot = 0; slot < CONTACTS; slot++)
        if (state->contacts[slot].until >= 0.0)
            attach(state, slot, m->position, m->direction);
    renew(state);
}

/* Move the slider along a line; return the slope of the force at the end. */
static double step(Memory *state, double h, double end)
{
    Motion *m = &state->motion;
    double side = end > m->position ? 1.0 : end < m->position ? -1.0 : 0.0;
    m->impulse = 0.0;
    if (side != m->direction) {
        arrests(state);
        if (side != 0.0)
            m->direction = side;
    }
    double v = (end - m->position) / h;
    Path path = {m->position, v, h, end, side, m->slid, INFINITY};
    if (SLIDING_FORCE > 0.0 && side != 0.0) {
        double left = SLIDING_FORCE - side * m->slid;
        if (side * (end - m->position) >= left)
            path.yields = when(&path, left);
    }
    if (happens(m, &state->sums, &path))
        events(state, &path);
    else
        pass(m, &state->sums, &path);
    if (SLIDING_FORCE > 0.0) {
        m->slid += end - m->position;
        m->slid = fmin(fmax(m->slid, -SLIDING_FORCE), SLIDING_FORCE);
    }
    m->position = end;
    double more = h + m->carry;
    double time = m->time + more;
    m->carry = more - (time - m->time);
    m->time = time;
    int elastic = SLIDING_FORCE > 0.0 && isinf(path.yields);
    return (state->sums.stiffness + (elastic ? state->sums.free : 0.0)) / CONTACTS;
}

static double force_of(const Memory *state)
{
    const Sums *sums = &state->sums;
    const Motion *m = &state->motion;
    double force = sums->stiffness * m->position - sums->origins;
    return (force + sums->free * m->slid) / CONTACTS;
}

/* ---- FMI 2.0: only what this unit needs of its types */

typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error } fmi2Status;
typedef void *fmi2Component;
typedef unsigned int Reference;
typedef const char *Text;

enum { DISPLACEMENT, VELOCITY, FORCE_OUT, STIFFNESS_OUT, IMPULSE_OUT };

typedef struct {
    char guid[40];
    double input[2]; /* displacement and velocity, in the units of the rig */
    double offset;   /* displacement at which the contacts begin */
    double stiffness;
    Memory contacts;
} State;

#define API __attribute__((visibility("default")))

API Text fmi2GetTypesPlatform(void) { return "default"; }

API Text fmi2GetVersion(void) { return "2.0"; }

static void begin(State *state)
{
    memset(state, 0, sizeof *state);
    strcpy(state->guid, GUID);
    memcpy(&state->contacts, BEGIN, sizeof state->contacts);
    state->stiffness = state->contacts.sums.stiffness / CONTACTS;
}

API fmi2Component fmi2Instantiate(Text name, int kind, Text guid, Text resources,
    const void *functions, int visible, int logging)
{
    (void)name, (void)resources, (void)functions, (void)visible, (void)logging;
    if (kind != 1 || guid == NULL || strcmp(guid, GUID) != 0)
        return NULL;
    State *state = malloc(sizeof *state);
    if (state != NULL)
        begin(state);
    return state;
}

API void fmi2FreeInstance(fmi2Component c) { free(c); }

API fmi2Status fmi2SetDebugLogging(fmi2Component c, int on, size_t n, const Text t[])
{
    (void)c, (void)on, (void)n, (void)t;
    return fmi2OK;
}

API fmi2Status fmi2SetupExperiment(
    fmi2Component c, int given, double tolerance, double start, int ends, double stop)
{
    (void)c, (void)given, (void)tolerance, (void)start, (void)ends, (void)stop;
    return fmi2OK;
}

API fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    (void)c;
    return fmi2OK;
}

API fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    State *state = c;
    state->offset = state->input[DISPLACEMENT];
    return fmi2OK;
}

API fmi2Status fmi2Terminate(fmi2Component c)
{
    (void)c;
    return fmi2OK;
}

API fmi2Status fmi2Reset(fmi2Component c)
{
    begin(c);
    return fmi2OK;
}

API fmi2Status fmi2GetReal(
    fmi2Component c, const Reference wanted[], size_t count, double values[])
{
    const State *state = c;
    for (size_t i = 0; i < count; i++) {
        switch (wanted[i]) {
        case DISPLACEMENT:
        case VELOCITY:
            values[i] = state->input[wanted[i]];
            break;
        case FORCE_OUT:
            values[i] = FORCE * force_of(&state->contacts);
            break;
        case STIFFNESS_OUT:
            values[i] = STIFFNESS * state->stiffness;
            break;
        case IMPULSE_OUT:
            values[i] = FORCE * TIME * state->contacts.motion.impulse / CONTACTS;
            break;
        default:
            return fmi2Error;
        }
    }
    return fmi2OK;
}

API fmi2Status fmi2SetReal(
    fmi2Component c, const Reference given[], size_t count, const double values[])
{
    State *state = c;
    for (size_t i = 0; i < count; i++) {
        if (given[i] > VELOCITY || !isfinite(values[i]))
            return fmi2Error;
        state->input[given[i]] = values[i];
    }
    return fmi2OK;
}

/* Inputs are those at the beginning of a step; the slider keeps its velocity in it. */
API fmi2Status fmi2DoStep(fmi2Component c, double now, double duration, int no_return)
{
    State *state = c;
    (void)now, (void)no_return;
    double way_on = duration * state->input[VELOCITY];
    double end = (state->input[DISPLACEMENT] - state->offset + way_on) / LENGTH;
    double distance = fabs(end - state->contacts.motion.position);
    if (!(duration > 0.0) || !(distance <= FARTHEST))
        return fmi2Error;
    state->stiffness = step(&state->contacts, duration / TIME, end);
    return fmi2OK;
}

API fmi2Status fmi2GetFMUstate(fmi2Component c, void **kept)
{
    if (*kept == NULL)
        *kept = malloc(sizeof(State));
    if (*kept == NULL)
        return fmi2Error;
    memcpy(*kept, c, sizeof(State));
    return fmi2OK;
}

API fmi2Status fmi2SetFMUstate(fmi2Component c, void *kept)
{
    memcpy(c, kept, sizeof(State));
    return fmi2OK;
}

API fmi2Status fmi2FreeFMUstate(fmi2Component c, void **kept)
{
    (void)c;
    free(*kept);
    *kept = NULL;
    return fmi2OK;
}

API fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, void *kept, size_t *size)
{
    (void)c, (void)kept;
    *size = sizeof(State);
    return fmi2OK;
}

API fmi2Status fmi2SerializeFMUstate(
    fmi2Component c, void *kept, char bytes[], size_t size)
{
    (void)c;
    if (size < sizeof(State))
        return fmi2Error;
    memcpy(bytes, kept, sizeof(State));
    return fmi2OK;
}

API fmi2Status fmi2DeSerializeFMUstate(
    fmi2Component c, const char bytes[], size_t size, void **kept)
{
    const char *guid = bytes;
    if (size != sizeof(State) || memcmp(guid, GUID, sizeof GUID) != 0)
        return fmi2Error;
    *kept = NULL;
    fmi2Status status = fmi2GetFMUstate(c, kept);
    if (status == fmi2OK)
        memcpy(*kept, bytes, size);
    return status;
}

/* ---- functions of FMI for variables, derivatives and steps that this unit lacks */

#define NOT_HERE(name, ...)                                                            \
    API fmi2Status name(fmi2Component c, __VA_ARGS__)                                  \
    {                                                                                  \
        (void)c, (void)a, (void)n, (void)b;                                            \
        return n == 0 ? fmi2OK : fmi2Error;                                            \
    }

NOT_HERE(fmi2GetInteger, const Reference a[], size_t n, int b[])
NOT_HERE(fmi2GetBoolean, const Reference a[], size_t n, int b[])
NOT_HERE(fmi2GetString, const Reference a[], size_t n, Text b[])
NOT_HERE(fmi2SetInteger, const Reference a[], size_t n, const int b[])
NOT_HERE(fmi2SetBoolean, const Reference a[], size_t n, const int b[])
NOT_HERE(fmi2SetString, const Reference a[], size_t n, const Text b[])

API fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const Reference u[],
    size_t nu, const Reference k[], size_t nk, const double dk[], double du[])
{
    (void)c, (void)u, (void)nu, (void)k, (void)nk, (void)dk, (void)du;
    return fmi2Error;
}

API fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const Reference r[],
    size_t n, const int order[], const double values[])
{
    (void)c, (void)r, (void)order, (void)values;
    return n == 0 ? fmi2OK : fmi2Error;
}

API fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const Reference r[],
    size_t n, const int order[], double values[])
{
    (void)c, (void)r, (void)order, (void)values;
    return n == 0 ? fmi2OK : fmi2Error;
}

API fmi2Status fmi2CancelStep(fmi2Component c)
{
    (void)c;
    return fmi2Error;
}

#define NO_STATUS(name, kind)                                                          \
    API fmi2Status name(fmi2Component c, int asked, kind *value)                       \
    {                                                                                  \
        (void)c, (void)asked, (void)value;                                             \
        return fmi2Discard;                                                            \
    }

NO_STATUS(fmi2GetStatus, int)
NO_STATUS(fmi2GetRealStatus, double)
NO_STATUS(fmi2GetIntegerStatus, int)
NO_STATUS(fmi2GetBooleanStatus, int)
NO_STATUS(fmi2GetStringStatus, Text)
