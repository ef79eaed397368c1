// Tuples of arrays that a call is handed, read by the tables `fields` of their structs: every array is checked for its
// type, dimensions, contiguity, writability and shape before a kernel sees its address, and held until the call ends.
#pragma once

#include "arguments.hpp"
#include "array.hpp"

namespace FEMIMPACT_TARGET {

constexpr int MOST_ARRAYS = 256;
constexpr int MOST_DEPTH = 4;

// The type at the border of an item of an array.
template <class T> constexpr Type type_of();
template <> constexpr Type type_of<double>() {
    return Type::float64;
}
template <> constexpr Type type_of<Complex>() {
    return Type::complex128;
}
template <> constexpr Type type_of<Index>() {
    return Type::int64;
}
template <> constexpr Type type_of<unsigned char>() {
    return Type::truth;
}

template <class T> struct Writable {
    using Item = T;
    static constexpr bool value = true;
};
template <class T> struct Writable<const T> {
    using Item = T;
    static constexpr bool value = false;
};

// The lengths that the letters of shapes stand for, each fixed by the first axis that has no other unknown letter.
class Lengths {
  public:
    // Whether an axis of a length is what its words say, as 2R+O or dK; the words are left at the next axis.
    bool fits(const char *&words, Index length) {
        Index known = 0, factor = 0;
        Index *unknown = nullptr;
        while (*words != '\0' && *words != ' ') {
            if (*words == '+')
                words++;
            Index product = 1;
            Index *open = nullptr;
            if (*words >= '0' && *words <= '9')
                product = *words++ - '0';
            for (; is_letter(*words); words++) {
                Index &of_letter = length_of(*words);
                if (of_letter < 0)
                    open = &of_letter;
                else if (__builtin_mul_overflow(product, of_letter, &product))
                    return false;
            }
            if (open != nullptr) {
                unknown = open;
                factor = product;
            } else if (__builtin_add_overflow(known, product, &known))
                return false;
        }
        while (*words == ' ')
            words++;
        if (unknown == nullptr)
            return known == length;
        if (length < known || factor == 0 || (length - known) % factor != 0)
            return false;
        *unknown = (length - known) / factor;
        return true;
    }

    Lengths() {
        for (Index &length : lengths_)
            length = -1;
    }

  private:
    static bool is_letter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); }
    Index &length_of(char letter) { return lengths_[letter >= 'a' ? letter - 'a' : 26 + letter - 'A']; }

    Index lengths_[52];
};

// A visitor that fills a struct from a tuple, and the structs within it from tuples within that one.
class FromTuple {
  public:
    FromTuple() = default;

    // False with an exception where the tuple is not what the table says.
    template <class Struct> bool read(const char *name, PyObject *tuple, Struct &values) {
        Within outer = enter(name, tuple);
        if (failed_)
            return false;
        values.fields(*this);
        if (!failed_ && place_ != size_)
            refuse_size();
        leave(outer);
        return !failed_;
    }

    template <class Struct> void group(const char *name, Struct &values, const char *) {
        PyObject *tuple = next(name);
        if (tuple != nullptr)
            read(name, tuple, values);
    }

    template <class T, int N> void operator()(const char *name, View<T, N> &view, const char *shape) {
        PyObject *object = next(name);
        if (object == nullptr)
            return;
        const Wanted wanted = {name, type_of<typename Writable<T>::Item>(), N, shape, Writable<T>::value, prefix_};
        if (count_ == MOST_ARRAYS || !arrays_[count_].take(object, wanted)) {
            failed_ = true;
            return;
        }
        const Argument &array = arrays_[count_++];
        const char *words = shape;
        for (int axis = 0; axis < N; axis++) {
            if (!lengths_.fits(words, array.size(axis))) {
                refuse_shape(wanted, array);
                return;
            }
            view.shape[axis] = array.size(axis);
        }
        view.data = static_cast<T *>(array.data());
    }

    void operator()(const char *name, double &number) {
        PyObject *object = next(name);
        if (object != nullptr && !take_number(object, name, &number, prefix_))
            failed_ = true;
    }
    void operator()(const char *name, Index &number) {
        PyObject *object = next(name);
        if (object == nullptr)
            return;
        number = PyLong_AsLongLong(object);
        if (number != -1 || PyErr_Occurred() == nullptr)
            return;
        PyErr_Clear();
        PyErr_Format(PyExc_TypeError, "%s%s: must be a whole number of 64 bits", prefix_, name);
        failed_ = true;
    }
    void operator()(const char *name, bool &truth) {
        PyObject *object = next(name);
        if (object == nullptr)
            return;
        const int value = PyObject_IsTrue(object);
        failed_ = value < 0;
        truth = value > 0;
    }

  private:
    struct Within {
        PyObject *tuple;
        Py_ssize_t place, size;
    };

    Within enter(const char *name, PyObject *tuple) {
        Within outer = {tuple_, place_, size_};
        if (depth_ == MOST_DEPTH || (PyType_GetFlags(tuple->ob_type) & Py_TPFLAGS_TUPLE_SUBCLASS) == 0) {
            PyErr_Format(PyExc_TypeError, "%s%s: must be a tuple of arrays and numbers", prefix_, name);
            failed_ = true;
            return outer;
        }
        names_[depth_++] = name;
        set_prefix();
        tuple_ = tuple;
        place_ = 0;
        size_ = PyTuple_Size(tuple);
        return outer;
    }
    void leave(const Within &outer) {
        depth_--;
        set_prefix();
        tuple_ = outer.tuple;
        place_ = outer.place;
        size_ = outer.size;
    }

    PyObject *next(const char *name) {
        if (failed_)
            return nullptr;
        if (place_ == size_) {
            PyErr_Format(PyExc_TypeError, "%s%s: is missing", prefix_, name);
            failed_ = true;
            return nullptr;
        }
        return PyTuple_GetItem(tuple_, place_++);
    }

    // Sets the prefix to the names of the tuples around a value, each with a point behind it.
    void set_prefix() {
        char *end = prefix_;
        for (int k = 0; k < depth_; k++) {
            for (const char *word = names_[k]; *word != '\0' && end < prefix_ + sizeof prefix_ - 2; word++)
                *end++ = *word;
            *end++ = '.';
        }
        *end = '\0';
    }

    void refuse_size() {
        PyErr_Format(PyExc_TypeError, "%s: must have %zd values, has %zd", names_[depth_ - 1], place_, size_);
        failed_ = true;
    }
    void refuse_shape(const Wanted &wanted, const Argument &array) {
        char words[80];
        int used = 0;
        for (int axis = 0; axis < wanted.axes; axis++)
            used += snprintf(words + used, sizeof words - used, " %zd", array.size(axis));
        PyErr_Format(PyExc_ValueError, "%s%s: must have the shape %s, with the lengths of the arrays before it; has%s",
                     prefix_, wanted.name, wanted.shape, words);
        failed_ = true;
    }

    Argument arrays_[MOST_ARRAYS];
    int count_ = 0;
    Lengths lengths_;
    PyObject *tuple_ = nullptr;
    Py_ssize_t place_ = 0, size_ = 0;
    const char *names_[MOST_DEPTH] = {};
    int depth_ = 0;
    char prefix_[120] = {};
    bool failed_ = false;
};

// Lists names, types, shapes and writability of all values, in the order in which they are handed over, and the names
// of rows.
class ToList {
  public:
    explicit ToList(PyObject *list) : list_(list) {}

    template <class Struct> void group(const char *name, Struct &values, const char *type) {
        const char *outer = prefix_;
        add(name, "tuple", type, false);
        char path[80];
        snprintf(path, sizeof path, "%s%s.", outer, name);
        prefix_ = path;
        values.fields(*this);
        prefix_ = outer;
    }
    template <class T, int N> void operator()(const char *name, View<T, N> &, const char *shape) {
        add(name, name_of(type_of<typename Writable<T>::Item>()), shape, Writable<T>::value);
    }
    void operator()(const char *name, double &) { add(name, "float", "", false); }
    void operator()(const char *name, Index &) { add(name, "int", "", false); }
    void operator()(const char *name, bool &) { add(name, "bool", "", false); }

    // Names numbered from 0 on, in the place of a shape.
    void enumeration(const char *name, const char *names) { add(name, "names", names, false); }

    bool failed() const { return failed_; }

  private:
    void add(const char *name, const char *type, const char *shape, bool writable) {
        if (failed_)
            return;
        char path[120];
        snprintf(path, sizeof path, "%s%s", prefix_, name);
        PyObject *row = Py_BuildValue("(sssi)", path, type, shape, int(writable));
        failed_ = row == nullptr || PyList_Append(list_, row) != 0;
        if (row != nullptr)
            Py_DecRef(row);
    }

    PyObject *list_;
    const char *prefix_ = "";
    bool failed_ = false;
};

} // namespace FEMIMPACT_TARGET
