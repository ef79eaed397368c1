// Impulses of rigid contacts at one instant, solved together: p >= 0, A p - target >= 0, one of both zero for each.
//
// A = G M^-1 G^T is the approach speed that impulses take away. It is singular where there are more contacts than
// degrees of freedom: A p is unique all the same, and of the impulses with that A p those of least norm are taken.
#pragma once

#include "../array.hpp"
#include "../fields.hpp"

namespace FEMIMPACT_TARGET {

// Share of its own entry in A below which a contact has no motion beside others.
constexpr double DEPENDENT = 1e-12;

// Share of its entry that each contact gives way by where some depend on others, to find which of them push.
constexpr double GIVES_WAY = 1e-7;

// Share of the terms that make a speed below which it is their rounding.
constexpr double SPEED_ROUNDING = 1e-14;

// Working space for the impulses of up to R contacts; all but `rounding` are in the order of `pair`.
struct Impulses {
    FIELDS_BEGIN;
    ARRAY(rounding, "R", Array);              // m/s, of the rate of each pair
    ARRAY(pair, "R", View<Index, 1>);         // number of the pair
    ARRAY(held, "R", View<unsigned char, 1>); // whether the contact may pull as well
    ARRAY(pushes, "R", View<unsigned char, 1>);
    ARRAY(approach, "R", Array); // m/s, before
    ARRAY(target, "R", Array);   // m/s, the least that is to be taken away
    ARRAY(impulse, "R", Array);  // N s
    ARRAY(trial, "R", Array);
    ARRAY(mobility, "R R", Matrix); // A, 1/kg
    ARRAY(factor, "R R", Matrix);   // L D L^T
    ARRAY(normal, "R R", Matrix);   // L^T L
    ARRAY(order, "2 R", View<Index, 2>);
    ARRAY(size, "R", Array);
    ARRAY(solved, "R", Array);
    FIELDS_END;
};

// L D L^T of a symmetric matrix in place, the least dependent row first; returns the number of independent rows.
[[gnu::noinline]] inline Index factorise(const Matrix &f, View<Index, 1> order, Array size, Index n) {
    for (Index i = 0; i < n; i++)
        size(i) = f(i, i);
    for (Index k = 0; k < n; k++) {
        Index best = k;
        for (Index i = k + 1; i < n; i++)
            if (f(i, i) * size(best) > f(best, best) * size(i))
                best = i;
        if (!(f(best, best) > DEPENDENT * size(best)))
            return k;
        auto exchange = [](auto &a, auto &b) {
            auto kept = a;
            a = b;
            b = kept;
        };
        if (best != k) {
            exchange(order(k), order(best));
            exchange(size(k), size(best));
            exchange(f(k, k), f(best, best));
            for (Index j = 0; j < k; j++)
                exchange(f(k, j), f(best, j));
            for (Index j = k + 1; j < best; j++)
                exchange(f(j, k), f(best, j));
            for (Index j = best + 1; j < n; j++)
                exchange(f(j, k), f(j, best));
        }
        // the column below the pivot is divided by it once all of it is used
        for (Index i = k + 1; i < n; i++)
            for (Index j = k + 1; j <= i; j++)
                f(i, j) -= f(i, k) / f(k, k) * f(j, k);
        for (Index i = k + 1; i < n; i++)
            f(i, k) /= f(k, k);
    }
    return n;
}

// Solves L D L^T x = x in place.
[[gnu::always_inline]] inline void substitute(const Matrix &f, Array x, Index n) {
    for (Index i = 0; i < n; i++)
        for (Index j = 0; j < i; j++)
            x(i) -= f(i, j) * x(j);
    for (Index i = n - 1; i >= 0; i--) {
        x(i) /= f(i, i);
        for (Index j = i + 1; j < n; j++)
            x(i) -= f(j, i) * x(j);
    }
}

// Factorises A of the contacts that push, which give way by a share of it; how many there are and are independent.
struct Pushing {
    Index count, independent;
};
[[gnu::noinline]] inline Pushing factorise_pushing(double gives_way, const Impulses &x, Index n) {
    View<Index, 1> order = x.order.row(0);
    Index count = 0;
    for (Index i = 0; i < n; i++)
        if (x.pushes(i))
            order(count++) = i;
    for (Index i = 0; i < count; i++) {
        for (Index j = 0; j < i; j++)
            x.factor(i, j) = x.mobility(order(i), order(j));
        x.factor(i, i) = x.mobility(order(i), order(i)) * (1.0 + gives_way);
    }
    return {count, factorise(x.factor, order, x.size, count)};
}

// Sets the impulses with which those that push meet their targets; false where some of them depend on others.
[[gnu::noinline]] inline bool meet_targets(double gives_way, const Impulses &x, Index n) {
    auto [count, independent] = factorise_pushing(gives_way, x, n);
    if (independent < count)
        return false;
    for (Index i = 0; i < count; i++)
        x.solved(i) = x.target(x.order(0, i));
    substitute(x.factor, x.solved, count);
    for (Index i = 0; i < n; i++)
        x.trial(i) = 0.0;
    for (Index i = 0; i < count; i++)
        x.trial(x.order(0, i)) = x.solved(i);
    return true;
}

// Goes from the present impulses towards those that meet the targets, and lets go what would pull, until none does.
[[gnu::noinline]] inline bool push_without_pulling(double gives_way, const Impulses &x, Index n) {
    while (true) {
        if (!meet_targets(gives_way, x, n))
            return false;
        double part = 1.0;
        auto pulls = [&](Index i) { return x.pushes(i) && !x.held(i) && x.trial(i) < 0.0; };
        auto reached = [&](Index i) { return x.impulse(i) / (x.impulse(i) - x.trial(i)); };
        for (Index i = 0; i < n; i++)
            if (pulls(i))
                part = smaller(part, reached(i));
        if (part == 1.0)
            break;
        for (Index i = 0; i < n; i++) {
            bool stops = pulls(i) && reached(i) <= part;
            x.impulse(i) = stops ? 0.0 : x.impulse(i) + part * (x.trial(i) - x.impulse(i));
            x.pushes(i) = x.pushes(i) && !stops;
        }
    }
    for (Index i = 0; i < n; i++)
        x.impulse(i) = x.trial(i);
    return true;
}

// Contact without a push that misses its target by most, -1 for none.
[[gnu::noinline]] inline Index worst_contact(const Impulses &x, Index n) {
    double most = 0.0;
    Index worst = -1;
    for (Index i = 0; i < n; i++) {
        if (x.pushes(i))
            continue;
        double missing = x.target(i), size = magnitude(x.target(i));
        for (Index j = 0; j < n; j++) {
            missing -= x.mobility(i, j) * x.impulse(j);
            size += magnitude(x.mobility(i, j) * x.impulse(j));
        }
        if (missing > SPEED_ROUNDING * size && missing > most) {
            most = missing;
            worst = i;
        }
    }
    return worst;
}

// Finds which contacts push, by the active sets of Lawson and Hanson; false where some depend on others.
[[gnu::noinline]] inline bool find_pushing(double gives_way, const Impulses &x, Index n) {
    for (Index i = 0; i < n; i++) {
        x.pushes(i) = 1;
        x.impulse(i) = 0.0;
    }
    // each set is met once: more than a few times their number are rounding
    for (Index step = 0; step < 10 * n; step++) {
        if (!push_without_pulling(gives_way, x, n))
            return false;
        Index worst = worst_contact(x, n);
        if (worst < 0)
            break;
        x.pushes(worst) = 1;
    }
    return true;
}

// Of the impulses with the same A p sets those of least norm: L y with L D L^T L y = target.
[[gnu::noinline]] inline void share_evenly(const Impulses &x, Index n) {
    auto [count, rank] = factorise_pushing(0.0, x, n);
    const Matrix &f = x.factor, &normal = x.normal;
    View<Index, 1> order = x.order.row(0), turned = x.order.row(1);
    auto entry = [&](Index i, Index j) { return i == j ? 1.0 : i > j ? f(i, j) : 0.0; };
    for (Index i = 0; i < rank; i++) {
        x.trial(i) = x.target(order(i));
        for (Index j = 0; j < i; j++)
            x.trial(i) -= f(i, j) * x.trial(j);
    }
    for (Index i = 0; i < rank; i++) {
        turned(i) = i;
        for (Index j = 0; j <= i; j++) {
            normal(i, j) = 0.0;
            for (Index k = i; k < count; k++)
                normal(i, j) += entry(k, i) * entry(k, j);
        }
    }
    for (Index i = 0; i < rank; i++)
        x.trial(i) /= f(i, i);
    Index kept = factorise(normal, turned, x.size, rank);
    for (Index i = 0; i < kept; i++)
        x.solved(i) = x.trial(turned(i));
    substitute(normal, x.solved, kept);
    for (Index i = 0; i < n; i++)
        x.impulse(i) = 0.0;
    for (Index k = 0; k < count; k++)
        for (Index i = 0; i < kept; i++)
            x.impulse(order(k)) += entry(k, turned(i)) * x.solved(i);
}

// Sets the impulses of n contacts.
[[gnu::noinline]] inline void solve_impulses(const Impulses &x, Index n) {
    if (find_pushing(0.0, x, n))
        return;
    find_pushing(GIVES_WAY, x, n);
    for (bool pulls = true; pulls;) {
        share_evenly(x, n);
        pulls = false;
        for (Index i = 0; i < n; i++)
            if (x.impulse(i) < 0.0 && !x.held(i)) {
                x.pushes(i) = 0;
                x.impulse(i) = 0.0;
                pulls = true;
            }
    }
}

} // namespace FEMIMPACT_TARGET
