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

/* Modal coordinates, one case: the modes (at most 8) fill one SIMD register. */
void modal_one(int modes, long steps, long start, double dt, double amplitude, double omega, const double *k,
               const double *c, const double *load, const double *row, const wall *pair, long every,
               double *trace, double *peak_rms) {
    double q = 0.25 * dt * dt;
    lane p = fill(0.0), w = fill(0.0), pp = p, pw = p, pg = p, wp = p, ww = p, wg = p, tp = p, tw = p, rp = p, rw = p;
    lane hp = p, hw = p;
    double tg = 0.0, rg = 0.0, th = 0.0;
    for (int i = 0; i < modes; i++) {
        double s = 1.0 / (1.0 + 0.5 * dt * c[i] + q * k[i]);
        pp[i] = 1.0 - dt * dt * s * k[i], pw[i] = dt - dt * dt * s * c[i], pg[i] = -dt * dt * s * load[i];
        wp[i] = -dt * s * k[i], ww[i] = 1.0 - dt * s * c[i], wg[i] = -dt * s * load[i];
        tp[i] = row[i] * (1.0 - q * s * k[i]), tw[i] = -row[i] * q * s * c[i], tg -= row[i] * q * s * load[i];
        rp[i] = -row[i] * 0.5 * dt * s * k[i], rw[i] = row[i] * (1.0 - 0.5 * dt * s * c[i]);
        rg -= row[i] * 0.5 * dt * s * load[i];
        hp[i] = dt * dt * s * row[i], hw[i] = dt * s * row[i], th += q * s * row[i] * row[i];
    }
    double yp = 0.0, yw = 0.0, peak = 0.0, sum = 0.0, cosine = 1.0, sine = 0.0;
    double turn_c = cos(omega * dt), turn_s = sin(omega * dt), top = -amplitude * omega * omega;
    for (long n = 1; n <= steps; n++) {
        double next = sine * turn_c + cosine * turn_s;
        cosine = cosine * turn_c - sine * turn_s;
        sine = next;
        double acting = top * sine;
        lane part = tp * p + tw * w;
        double tip = ((part[0] + part[4]) + (part[1] + part[5])) + ((part[2] + part[6]) + (part[3] + part[7])) + tg * acting;
        lane p_new = pp * p + (pw * w + pg * acting);
        lane w_new = ww * w + (wp * p + wg * acting);
        if (pair->ball != 0.0) {
            double x = yp - q * acting - tip;
            double force = 0.0;
            if (x > pair->plus || x < -pair->minus) {
                lane slow = rp * p + rw * w;
                double rate = rg * acting;
                for (int i = 0; i < WIDTH; i++) rate += slow[i];
                force = force_of(pair, dt, x, yw - 0.5 * dt * acting - rate);
                p_new += hp * force;
                w_new += hw * force;
                tip += th * force;
            }
            double a = -acting - force / pair->mass;
            yp += dt * yw + dt * dt * a;
            yw += dt * a;
        }
        p = p_new;
        w = w_new;
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
