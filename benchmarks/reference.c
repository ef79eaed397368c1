/* Hand-written reference loops: Newmark, average acceleration, one ball between two Kelvin-Voigt walls.
 *
 * State of a dof between two steps: p and w, the displacement and velocity that the step predicts. With
 * the new acceleration a they go on by p += dt w + dt^2 a, w += dt a, so that u, v and a are never stored;
 * u = p + dt^2/4 a, v = w + dt/2 a. Contact is the scalar equation of the step: S^-1 b is prepared outside.
 * Peak and sum of squares of the tip are taken in the window. No -ffast-math: nothing is reordered by the compiler.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define WIDTH 8
typedef double lane __attribute__((vector_size(8 * WIDTH), aligned(8 * WIDTH)));
typedef long mask __attribute__((vector_size(8 * WIDTH), aligned(8 * WIDTH)));

/* what a ball and its walls are made of; mobility = 1/m + b^T S^-1 b; ball = 0 leaves it out */
typedef struct {
    double ball, mass, plus, minus, stiffness, damping, mobility;
} wall;

static lane fill(double value) {
    lane out;
    for (int k = 0; k < WIDTH; k++) out[k] = value;
    return out;
}

/* one step of one ball that nothing touches: its predicted place and speed are for this step */
static double force_of(const wall *pair, double dt, double x, double rate) {
    double side = x > pair->plus ? 1.0 : x < -pair->minus ? -1.0 : 0.0;
    if (side == 0.0) return 0.0;
    double depth = side > 0.0 ? x - pair->plus : -x - pair->minus;
    double push = pair->stiffness * depth + pair->damping * side * rate;
    if (push <= 0.0) return 0.0;
    return side * push / (1.0 + pair->mobility * (0.25 * dt * dt * pair->stiffness + 0.5 * dt * pair->damping));
}

/* tables of a step, one mode a lane: of what p, w, the tip and its velocity are at the end; h: of 1 N at the tip */
typedef struct {
    lane pp, pw, pg, wp, ww, wg, tp, tw, rp, rw, hp, hw;
    double dt, tg, rg, th, turn_c, turn_s;
} modal;

/* between two steps; `past` is the w before the last step, so that (w - past)/dt is the acceleration */
typedef struct {
    lane p, w, past;
    double yp, yw, y_past;
} state;

/* at a step's end: the tip, and where a ball is and how fast, relative to it */
typedef struct {
    double tip, x, rate;
} place;

static modal modal_tables(int modes, double dt, double omega, const double *k, const double *c, const double *load,
                          const double *row) {
    double q = 0.25 * dt * dt;
    modal m;
    memset(&m, 0, sizeof m);
    for (int i = 0; i < modes; i++) {
        double s = 1.0 / (1.0 + 0.5 * dt * c[i] + q * k[i]);
        m.pp[i] = 1.0 - dt * dt * s * k[i], m.pw[i] = dt - dt * dt * s * c[i], m.pg[i] = -dt * dt * s * load[i];
        m.wp[i] = -dt * s * k[i], m.ww[i] = 1.0 - dt * s * c[i], m.wg[i] = -dt * s * load[i];
        m.tp[i] = row[i] * (1.0 - q * s * k[i]), m.tw[i] = -row[i] * q * s * c[i], m.tg -= row[i] * q * s * load[i];
        m.rp[i] = -row[i] * 0.5 * dt * s * k[i], m.rw[i] = row[i] * (1.0 - 0.5 * dt * s * c[i]);
        m.rg -= row[i] * 0.5 * dt * s * load[i];
        m.hp[i] = dt * dt * s * row[i], m.hw[i] = dt * s * row[i], m.th += q * s * row[i] * row[i];
    }
    m.dt = dt, m.turn_c = cos(omega * dt), m.turn_s = sin(omega * dt);
    return m;
}

static inline double turned(const modal *m, double *cosine, double *sine) {
    double next = *sine * m->turn_c + *cosine * m->turn_s;
    *cosine = *cosine * m->turn_c - *sine * m->turn_s;
    return *sine = next;
}

/* one step of modes and ball; the velocity is read where the ball touches, or where it is asked for */
static inline __attribute__((always_inline)) place modal_next(const modal *m, const wall *pair, double acting,
                                                              int asked, state *s) {
    double dt = m->dt, q = 0.25 * dt * dt, force = 0.0;
    lane p = s->p, w = s->w, part = m->tp * p + m->tw * w;
    place now = {0.0, 0.0, 0.0};
    now.tip = ((part[0] + part[4]) + (part[1] + part[5])) + ((part[2] + part[6]) + (part[3] + part[7]));
    now.tip += m->tg * acting;
    s->p = m->pp * p + (m->pw * w + m->pg * acting);
    s->w = m->ww * w + (m->wp * p + m->wg * acting);
    s->past = w;
    if (pair->ball == 0.0) return now;
    now.x = s->yp - q * acting - now.tip;
    if (asked || now.x > pair->plus || now.x < -pair->minus) {
        lane slow = m->rp * p + m->rw * w;
        double rate = m->rg * acting;
        for (int i = 0; i < WIDTH; i++) rate += slow[i];
        now.rate = s->yw - 0.5 * dt * acting - rate;
        force = force_of(pair, dt, now.x, now.rate);
        s->p += m->hp * force;
        s->w += m->hw * force;
        now.tip += m->th * force;
        now.x -= q * pair->mobility * force;
        now.rate -= 0.5 * dt * pair->mobility * force;
    }
    double a = -acting - force / pair->mass;
    s->y_past = s->yw;
    s->yp += dt * s->yw + dt * dt * a;
    s->yw += dt * a;
    return now;
}

/* Modal coordinates, one case: the modes (at most 8) fill one SIMD register. */
void modal_one(int modes, long steps, long start, double dt, double amplitude, double omega, const double *k,
               const double *c, const double *load, const double *row, const wall *pair, long every,
               double *trace, double *peak_rms) {
    modal m = modal_tables(modes, dt, omega, k, c, load, row);
    state s;
    memset(&s, 0, sizeof s);
    double peak = 0.0, sum = 0.0, cosine = 1.0, sine = 0.0, top = -amplitude * omega * omega;
    for (long n = 1; n <= steps; n++) {
        double tip = modal_next(&m, pair, top * turned(&m, &cosine, &sine), 0, &s).tip;
        if (n > start) {
            double size = fabs(tip);
            peak = size > peak ? size : peak;
            sum += tip * tip;
        }
        if (every && n % every == 0) trace[n / every - 1] = tip;
    }
    peak_rms[0] = peak;
    peak_rms[1] = sqrt(sum / (double)(steps - start));
}

/* the same state for steps of another size: u, v and a stay */
static state resized(state s, double from, double to) {
    lane a = (s.w - s.past) / from, v = s.w - 0.5 * from * a, u = s.p - from * v - 0.25 * from * from * a;
    double b = (s.yw - s.y_past) / from, z = s.yw - 0.5 * from * b, y = s.yp - from * z - 0.25 * from * from * b;
    s.p = u + to * v + 0.25 * to * to * a, s.w = v + 0.5 * to * a, s.past = s.w - to * a;
    s.yp = y + to * z + 0.25 * to * to * b, s.yw = z + 0.5 * to * b, s.y_past = s.yw - to * b;
    return s;
}

/* Modal coordinates, one case, adaptive step: one in which the ball may touch is taken again in `parts` fine ones.
 *
 * The cubic through both ends of a step with their velocities stays below max(x0, x1) + 4/27 dt (|v0| + |v1|).
 * The pair's mobility is that of the fine step; peak and sum of squares are of the coarse ones.
 */
void modal_adaptive(int modes, long steps, long start, double dt, double amplitude, double omega, const double *k,
                    const double *c, const double *load, const double *row, const wall *pair, long every,
                    double *trace, double *peak_rms, long parts) {
    double small = dt / (double)parts, reach = dt * 4.0 / 27.0;
    modal coarse = modal_tables(modes, dt, omega, k, c, load, row);
    modal fine = modal_tables(modes, small, omega, k, c, load, row);
    state s;
    memset(&s, 0, sizeof s);
    place last = {0.0, 0.0, 0.0};
    double peak = 0.0, sum = 0.0, cosine = 1.0, sine = 0.0, top = -amplitude * omega * omega;
    for (long n = 1; n <= steps; n++) {
        state begun = s;
        double cosine_fine = cosine, sine_fine = sine;
        place now = modal_next(&coarse, pair, top * turned(&coarse, &cosine, &sine), 1, &s);
        double beyond = reach * (fabs(last.rate) + fabs(now.rate));
        double high = now.x > last.x ? now.x : last.x, low = now.x < last.x ? now.x : last.x;
        if (pair->ball != 0.0 && (high + beyond > pair->plus || low - beyond < -pair->minus)) {
            s = resized(begun, dt, small);
            for (long i = 1; i <= parts; i++)
                now = modal_next(&fine, pair, top * turned(&fine, &cosine_fine, &sine_fine), i == parts, &s);
            s = resized(s, small, dt);
        }
        last = now;
        if (n > start) {
            double size = fabs(now.tip);
            peak = size > peak ? size : peak;
            sum += now.tip * now.tip;
        }
        if (every && n % every == 0) trace[n / every - 1] = now.tip;
    }
    peak_rms[0] = peak;
    peak_rms[1] = sqrt(sum / (double)(steps - start));
}

/* scalars of eight cases side by side: drive, ball and statistics */
typedef struct {
    lane cosine, sine, turn_c, turn_s, top, yp, yw, peak, sum;
} eight;

static void begin(eight *s, double dt, double amplitude, const double *omega) {
    memset(s, 0, sizeof *s);
    for (int k = 0; k < WIDTH; k++) {
        s->cosine[k] = 1.0, s->turn_c[k] = cos(omega[k] * dt), s->turn_s[k] = sin(omega[k] * dt);
        s->top[k] = -amplitude * omega[k] * omega[k];
    }
}

static lane drive(eight *s) {
    lane next = s->sine * s->turn_c + s->cosine * s->turn_s;
    s->cosine = s->cosine * s->turn_c - s->sine * s->turn_s;
    s->sine = next;
    return s->top * next;
}

/* the ball's step beside the free step of the structure; says whether any lane touches */
static int contact(eight *s, const wall *pair, double dt, lane acting, lane tip, lane rate, lane *force) {
    double q = 0.25 * dt * dt;
    lane x = s->yp - q * acting - tip;
    lane zero = fill(0.0);
    mask out = (x > pair->plus) | (x < -pair->minus);
    long any = 0;
    for (int k = 0; k < WIDTH; k++) any |= out[k];
    *force = zero;
    if (any) {
        lane speed = s->yw - 0.5 * dt * acting - rate;
        for (int k = 0; k < WIDTH; k++) (*force)[k] = force_of(pair, dt, x[k], speed[k]);
    }
    lane a = -acting - *force * (1.0 / pair->mass);
    s->yp += dt * s->yw + dt * dt * a;
    s->yw += dt * a;
    return any != 0;
}

static void measure(eight *s, lane tip) {
    mask no_sign = (mask)fill(-0.0);
    lane size = (lane)((mask)tip & ~no_sign);
    mask more = size > s->peak;
    s->peak = (lane)((more & (mask)size) | (~more & (mask)s->peak));
    s->sum += tip * tip;
}

static void finish(const eight *s, long count, double *peak_rms) {
    for (int k = 0; k < WIDTH; k++) {
        peak_rms[2 * k] = s->peak[k];
        peak_rms[2 * k + 1] = sqrt(s->sum[k] / (double)count);
    }
}

static void keep(long n, long every, lane tip, double *trace) {
    if (every && n % every == 0) memcpy(trace + (n / every - 1) * WIDTH, &tip, sizeof tip);
}

/* Modal coordinates, eight cases side by side: the lanes are cases. */
void modal_eight(int modes, long steps, long start, double dt, double amplitude, const double *omega, const double *k,
                 const double *c, const double *load, const double *row, const wall *pair, long every, double *trace,
                 double *peak_rms) {
    double q = 0.25 * dt * dt;
    size_t bytes = (size_t)modes * sizeof(lane);
    lane *p = aligned_alloc(64, bytes), *w = aligned_alloc(64, bytes);
    double *t = malloc((size_t)modes * 12 * sizeof(double));
    double tg = 0.0, rg = 0.0, th = 0.0;
    memset(p, 0, bytes), memset(w, 0, bytes);
    for (int i = 0; i < modes; i++) {
        double s = 1.0 / (1.0 + 0.5 * dt * c[i] + q * k[i]), *m = t + 12 * i;
        m[0] = 1.0 - dt * dt * s * k[i], m[1] = dt - dt * dt * s * c[i], m[2] = -dt * dt * s * load[i];
        m[3] = -dt * s * k[i], m[4] = 1.0 - dt * s * c[i], m[5] = -dt * s * load[i];
        m[6] = row[i] * (1.0 - q * s * k[i]), m[7] = -row[i] * q * s * c[i];
        m[8] = -row[i] * 0.5 * dt * s * k[i], m[9] = row[i] * (1.0 - 0.5 * dt * s * c[i]);
        m[10] = dt * dt * s * row[i], m[11] = dt * s * row[i];
        tg -= row[i] * q * s * load[i], rg -= row[i] * 0.5 * dt * s * load[i], th += q * s * row[i] * row[i];
    }
    eight s;
    begin(&s, dt, amplitude, omega);
    for (long n = 1; n <= steps; n++) {
        lane acting = drive(&s), tip = tg * acting, rate = rg * acting, force;
        for (int i = 0; i < modes; i++) {
            const double *m = t + 12 * i;
            lane pi = p[i], wi = w[i];
            tip += m[6] * pi + m[7] * wi;
            rate += m[8] * pi + m[9] * wi;
            p[i] = m[0] * pi + (m[1] * wi + m[2] * acting);
            w[i] = m[4] * wi + (m[3] * pi + m[5] * acting);
        }
        if (pair->ball != 0.0 && contact(&s, pair, dt, acting, tip, rate, &force)) {
            for (int i = 0; i < modes; i++) p[i] += t[12 * i + 10] * force, w[i] += t[12 * i + 11] * force;
            tip += th * force;
        }
        if (n > start) measure(&s, tip);
        keep(n, every, tip, trace);
    }
    finish(&s, steps - start, peak_rms);
    free(p), free(w), free(t);
}

/* Physical dofs of a beam, eight cases side by side.
 *
 * rows: 24 numbers a dof: C[i, i-3..i+3], K[i, i-3..i+3], L[i, i-3..i-1], 1/D[i], L[i+1..i+3, i], load, h, spare
 * with S = L D L^T and h = S^-1 b. Two sweeps a step: right-hand side and forward substitution; then back
 * substitution with the update. A third one only where some case touches.
 */
void physical_eight(int dofs, int at, long steps, long start, double dt, double amplitude, const double *omega,
                    const double *rows, const wall *pair, long every, double *trace, double *peak_rms) {
    double q = 0.25 * dt * dt;
    size_t bytes = (size_t)(dofs + 6) * sizeof(lane);
    lane *block = aligned_alloc(64, 3 * bytes);
    memset(block, 0, 3 * bytes);
    lane *p = block + 3, *w = p + dofs + 6, *z = w + dofs + 6;
    eight s;
    begin(&s, dt, amplitude, omega);
    for (long n = 1; n <= steps; n++) {
        lane acting = drive(&s), force;
        lane z1 = fill(0.0), z2 = z1, z3 = z1;
        for (int i = 0; i < dofs; i++) {
            const double *r = rows + 24 * i;
            /* four sums side by side: the chain through z1 is what a sweep waits for */
            lane one = r[0] * w[i - 3] + r[1] * w[i - 2] + r[2] * w[i - 1] + r[3] * w[i];
            lane two = r[4] * w[i + 1] + r[5] * w[i + 2] + r[6] * w[i + 3] + r[21] * acting;
            lane three = r[7] * p[i - 3] + r[8] * p[i - 2] + r[9] * p[i - 1] + r[10] * p[i];
            lane four = r[11] * p[i + 1] + r[12] * p[i + 2] + r[13] * p[i + 3];
            lane known = -((one + two) + (three + four)) - r[14] * z3 - r[15] * z2;
            lane now = known - r[16] * z1;
            z[i] = now * r[17];
            z3 = z2, z2 = z1, z1 = now;
        }
        lane a1 = fill(0.0), a2 = a1, a3 = a1, tip = a1, rate = a1;
        for (int i = dofs - 1; i >= 0; i--) {
            const double *r = rows + 24 * i;
            lane a = (z[i] - r[20] * a3 - r[19] * a2) - r[18] * a1;
            if (i == at) tip = p[i] + q * a, rate = w[i] + 0.5 * dt * a;
            p[i] += dt * w[i] + dt * dt * a;
            w[i] += dt * a;
            a3 = a2, a2 = a1, a1 = a;
        }
        if (pair->ball != 0.0 && contact(&s, pair, dt, acting, tip, rate, &force)) {
            lane pf = dt * dt * force, wf = dt * force;
            for (int i = 0; i < dofs; i++) p[i] += rows[24 * i + 22] * pf, w[i] += rows[24 * i + 22] * wf;
            tip += q * rows[24 * at + 22] * force;
        }
        if (n > start) measure(&s, tip);
        keep(n, every, tip, trace);
    }
    finish(&s, steps - start, peak_rms);
    free(block);
}
