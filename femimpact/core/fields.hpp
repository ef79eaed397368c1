// The values that a struct is handed from Python, each one line: a member, and its place in the table of names, types
// and shapes. A field is told from the others by its line, which is the same wherever the header is included.
#pragma once

namespace FEMIMPACT_TARGET {

template <int> struct Place {};

template <int N, int END, class Struct, class Visitor> void visit_places(Struct &values, Visitor &visit) {
    if constexpr (N < END) {
        if constexpr (requires { values.field(Place<N>{}, visit); })
            values.field(Place<N>{}, visit);
        visit_places<N + 1, END>(values, visit);
    }
}

} // namespace FEMIMPACT_TARGET

// Fields stand between both, one a line; `fields` visits them in their order.
#define FIELDS_BEGIN static constexpr int FIELDS_FROM = __LINE__
#define FIELDS_END                                                                                                     \
    static constexpr int FIELDS_TO = __LINE__;                                                                         \
    template <class Visitor> void fields(Visitor &visit) {                                                             \
        visit_places<FIELDS_FROM, FIELDS_TO>(*this, visit);                                                            \
    }                                                                                                                  \
    static_assert(FIELDS_FROM < FIELDS_TO)

// An array: its name in Python, where that is another one, its name, its shape, its type.
#define ARRAY_AS(handed, name, shape, ...)                                                                             \
    template <class Visitor> void field(Place<__LINE__>, Visitor &visit) {                                             \
        visit(handed, name, shape);                                                                                    \
    }                                                                                                                  \
    __VA_ARGS__ name
#define ARRAY(name, shape, ...) ARRAY_AS(#name, name, shape, __VA_ARGS__)

#define NUMBER(name, type)                                                                                             \
    template <class Visitor> void field(Place<__LINE__>, Visitor &visit) {                                             \
        visit(#name, name);                                                                                            \
    }                                                                                                                  \
    type name

// A struct within the struct: a tuple within the tuple.
#define GROUP_AS(handed, name, type)                                                                                   \
    template <class Visitor> void field(Place<__LINE__>, Visitor &visit) {                                             \
        visit.group(handed, name, #type);                                                                              \
    }                                                                                                                  \
    type name
#define GROUP(name, type) GROUP_AS(#name, name, type)

// Names numbered from 0 on, as rows of an array, and a text of them: Python has the same names.
#define ENUMERATION(text, ...)                                                                                         \
    enum : Index { __VA_ARGS__ };                                                                                      \
    constexpr const char *text = #__VA_ARGS__
