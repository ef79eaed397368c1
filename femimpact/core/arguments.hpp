// Arguments of the module's functions: each is checked against what it must be before a kernel sees its address.
#pragma once

#include "limited_api.hpp"

#include <cstdint>
#include <cstdio>
#include <cstring>

namespace FEMIMPACT_TARGET {

// the types of the border, as a buffer's format names them
enum class Type { float64, complex128, int64, truth };

// what an array must be: its axes in words are for messages only, their number counts
struct Wanted {
    const char *name;
    Type type;
    int axes;
    const char *shape;
    bool writable;
    // the names of the tuples around it, each with a point behind it
    const char *prefix = "";
};

inline const char *name_of(Type type) {
    switch (type) {
    case Type::float64:
        return "float64";
    case Type::complex128:
        return "complex128";
    case Type::int64:
        return "int64";
    case Type::truth:
        return "bool";
    }
    return "";
}

inline Py_ssize_t size_of(Type type) {
    return type == Type::complex128 ? 16 : type == Type::truth ? 1 : 8;
}

// whether a buffer's format is a type: native order alone, as '<' says on the processors of the targets
inline bool is_format(const char *format, Type type) {
    if (format == nullptr) {
        return false;
    }
    if (*format == '@' || *format == '=' || *format == '<') {
        format++;
    }
    switch (type) {
    case Type::float64:
        return strcmp(format, "d") == 0;
    case Type::complex128:
        return strcmp(format, "Zd") == 0;
    case Type::int64:
        return strcmp(format, "l") == 0 || strcmp(format, "q") == 0;
    case Type::truth:
        return strcmp(format, "?") == 0;
    }
    return false;
}

// One array of a call, held until the call ends: nobody can free or resize it meanwhile.
class Argument {
  public:
    Argument() = default;
    Argument(const Argument &) = delete;
    Argument &operator=(const Argument &) = delete;
    ~Argument() {
        if (held_) {
            PyBuffer_Release(&view_);
        }
    }

    // false with an exception where the object is not what is wanted
    bool take(PyObject *object, const Wanted &wanted) {
        if (PyObject_GetBuffer(object, &view_, PyBUF_RECORDS_RO) != 0) {
            // another exception, an interrupt for one, is not about the argument
            if (!PyErr_ExceptionMatches(PyExc_TypeError) && !PyErr_ExceptionMatches(PyExc_ValueError) &&
                !PyErr_ExceptionMatches(PyExc_BufferError)) {
                return false;
            }
            PyErr_Clear();
            return refuse(PyExc_TypeError, wanted, "this is none");
        }
        held_ = true;
        if (!is_format(view_.format, wanted.type) || view_.itemsize != size_of(wanted.type)) {
            return refuse(PyExc_TypeError, wanted, "this one has another type");
        }
        if (view_.ndim != wanted.axes) {
            char words[40];
            snprintf(words, sizeof words, "this one has %d axes", view_.ndim);
            return refuse(PyExc_ValueError, wanted, words);
        }
        if (!PyBuffer_IsContiguous(&view_, 'C')) {
            return refuse(PyExc_ValueError, wanted, "this one is not contiguous");
        }
        if (wanted.writable && view_.readonly) {
            return refuse(PyExc_ValueError, wanted, "this one is read-only");
        }
        if (view_.len > 0 && reinterpret_cast<std::uintptr_t>(view_.buf) % (wanted.type == Type::truth ? 1 : 8) != 0) {
            return refuse(PyExc_ValueError, wanted, "this one is not aligned");
        }
        return true;
    }

    void *data() const { return view_.buf; }
    double *doubles() const { return static_cast<double *>(view_.buf); }
    Py_ssize_t size(int axis) const { return view_.shape[axis]; }

  private:
    static bool refuse(PyObject *kind, const Wanted &wanted, const char *why) {
        PyErr_Format(kind, "%s%s: must be a contiguous%s array %s of %s; %s", wanted.prefix, wanted.name,
                     wanted.writable ? ", writable" : "", wanted.shape, name_of(wanted.type), why);
        return false;
    }

    Py_buffer view_ = {};
    bool held_ = false;
};

// false with an exception where the lengths of an axis differ
inline bool same_size(const Argument &one, const Argument &other, int axis, const char *names) {
    if (one.size(axis) == other.size(axis)) {
        return true;
    }
    PyErr_Format(PyExc_ValueError, "%s: must be equally long, are %zd and %zd", names, one.size(axis),
                 other.size(axis));
    return false;
}

// false with an exception where the object is no real number
inline bool take_number(PyObject *object, const char *name, double *number, const char *prefix = "") {
    *number = PyFloat_AsDouble(object);
    if (*number == -1.0 && PyErr_Occurred() != nullptr) {
        if (PyErr_ExceptionMatches(PyExc_TypeError)) {
            PyErr_Format(PyExc_TypeError, "%s%s: must be a number", prefix, name);
        }
        return false;
    }
    return true;
}

// false with an exception where a call has another number of arguments
inline bool take_count(Py_ssize_t given, Py_ssize_t wanted, const char *call) {
    if (given == wanted) {
        return true;
    }
    PyErr_Format(PyExc_TypeError, "%s: takes %zd arguments, not %zd", call, wanted, given);
    return false;
}

// While it lives other threads of Python run.
class WithoutLock {
  public:
    WithoutLock() : state_(PyEval_SaveThread()) {}
    WithoutLock(const WithoutLock &) = delete;
    WithoutLock &operator=(const WithoutLock &) = delete;
    ~WithoutLock() { PyEval_RestoreThread(state_); }

  private:
    PyThreadState *state_;
};

// None, once a call that other threads need not wait for has ended.
template <class Call> PyObject *run_apart(Call call) {
    {
        const WithoutLock others_run;
        call();
    }
    Py_IncRef(Py_None);
    return Py_None;
}

} // namespace FEMIMPACT_TARGET
