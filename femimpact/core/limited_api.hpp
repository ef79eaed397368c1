// Python's limited API of 3.11 (PEP 384): what the module uses of it, declared here.
//
// A machine without a compiler has no Python.h either (Debian keeps it in python3-dev), and the stable ABI is the same
// in every later version. A test compiles this file behind Python.h: a declaration or a layout that differs is an
// error. To use one more function, copy its declaration from Python's documentation ("Part of the Stable ABI").
#pragma once

#include <cstddef>

#if defined(_WIN32)
#define FEMIMPACT_PYTHON_DATA extern "C" __declspec(dllimport)
#define FEMIMPACT_EXPORTED __declspec(dllexport)
#else
#define FEMIMPACT_PYTHON_DATA extern "C"
#define FEMIMPACT_EXPORTED __attribute__((visibility("default")))
#endif

#ifndef Py_PYTHON_H

typedef std::ptrdiff_t Py_ssize_t;

struct PyTypeObject;
struct PyThreadState;

struct PyObject {
    Py_ssize_t ob_refcnt;
    PyTypeObject *ob_type;
};

struct Py_buffer {
    void *buf;
    PyObject *obj;
    Py_ssize_t len;
    Py_ssize_t itemsize;
    int readonly;
    int ndim;
    char *format;
    Py_ssize_t *shape;
    Py_ssize_t *strides;
    Py_ssize_t *suboffsets;
    void *internal;
};

extern "C" {
typedef PyObject *(*PyCFunction)(PyObject *, PyObject *);
typedef PyObject *(*PyInitFunction)();
}

struct PyMethodDef {
    const char *ml_name;
    PyCFunction ml_meth;
    int ml_flags;
    const char *ml_doc;
};

struct PyModuleDef_Base {
    PyObject ob_base;
    PyInitFunction m_init;
    Py_ssize_t m_index;
    PyObject *m_copy;
};

struct PyModuleDef {
    PyModuleDef_Base m_base;
    const char *m_name;
    const char *m_doc;
    Py_ssize_t m_size;
    PyMethodDef *m_methods;
    void *m_slots;
    void *m_traverse;
    void *m_clear;
    void *m_free;
};

#define METH_FASTCALL 0x0080
#define METH_NOARGS 0x0004
#define PyBUF_RECORDS_RO 0x001c
#define PYTHON_ABI_VERSION 3
#define Py_TPFLAGS_TUPLE_SUBCLASS (1UL << 26)

FEMIMPACT_PYTHON_DATA PyObject _Py_NoneStruct;
#define Py_None (&_Py_NoneStruct)

FEMIMPACT_PYTHON_DATA PyObject *PyExc_BufferError;
FEMIMPACT_PYTHON_DATA PyObject *PyExc_ImportError;
FEMIMPACT_PYTHON_DATA PyObject *PyExc_TypeError;
FEMIMPACT_PYTHON_DATA PyObject *PyExc_ValueError;

#endif

extern "C" {
PyObject *PyModule_Create2(PyModuleDef *, int);

void Py_IncRef(PyObject *);
void Py_DecRef(PyObject *);

int PyObject_GetBuffer(PyObject *, Py_buffer *, int);
int PyBuffer_IsContiguous(const Py_buffer *, char);
void PyBuffer_Release(Py_buffer *);

double PyFloat_AsDouble(PyObject *);
PyObject *PyFloat_FromDouble(double);
long long PyLong_AsLongLong(PyObject *);
PyObject *PyLong_FromLongLong(long long);
int PyObject_IsTrue(PyObject *);
PyObject *Py_BuildValue(const char *, ...);
PyObject *PyUnicode_FromString(const char *);
const char *PyUnicode_AsUTF8AndSize(PyObject *, Py_ssize_t *);
PyObject *PyTuple_New(Py_ssize_t);
int PyTuple_SetItem(PyObject *, Py_ssize_t, PyObject *);
PyObject *PyTuple_GetItem(PyObject *, Py_ssize_t);
Py_ssize_t PyTuple_Size(PyObject *);
PyObject *PyList_New(Py_ssize_t);
int PyList_Append(PyObject *, PyObject *);
unsigned long PyType_GetFlags(PyTypeObject *);

PyObject *PyErr_Occurred();
void PyErr_Clear();
int PyErr_ExceptionMatches(PyObject *);
void PyErr_SetString(PyObject *, const char *);
PyObject *PyErr_Format(PyObject *, const char *, ...);

PyThreadState *PyEval_SaveThread();
void PyEval_RestoreThread(PyThreadState *);
}

// the same on every platform of 64 bits; read by the test behind Python.h too
static_assert(sizeof(Py_ssize_t) == 8, "the core is made for 64 bits");
static_assert(sizeof(PyObject) == 16);
static_assert(sizeof(Py_buffer) == 80 && offsetof(Py_buffer, len) == 16 && offsetof(Py_buffer, itemsize) == 24);
static_assert(offsetof(Py_buffer, readonly) == 32 && offsetof(Py_buffer, ndim) == 36);
static_assert(offsetof(Py_buffer, format) == 40 && offsetof(Py_buffer, shape) == 48);
static_assert(offsetof(Py_buffer, strides) == 56 && offsetof(Py_buffer, suboffsets) == 64);
static_assert(sizeof(PyMethodDef) == 32 && offsetof(PyMethodDef, ml_flags) == 16 &&
              offsetof(PyMethodDef, ml_doc) == 24);
static_assert(sizeof(PyModuleDef_Base) == 40 && sizeof(PyModuleDef) == 104);
static_assert(offsetof(PyModuleDef, m_name) == 40 && offsetof(PyModuleDef, m_size) == 56);
static_assert(offsetof(PyModuleDef, m_methods) == 64 && offsetof(PyModuleDef, m_slots) == 72);
static_assert(METH_FASTCALL == 0x0080 && METH_NOARGS == 0x0004 && PyBUF_RECORDS_RO == 0x001c);
