// SPDX-License-Identifier: GPL-3.0-or-later
#include <exception>

#include "bindings.hpp"

namespace r4::python {
namespace {

// The class in r4link/errors.py for an error that is not about a command.
const char* error_class(ErrorKind kind) {
  switch (kind) {
    case ErrorKind::data:
      return "DataError";
    case ErrorKind::usage:
      return "UsageError";
    case ErrorKind::refused:
      return "RefusedError";
    case ErrorKind::open:
      return "OpenError";
    case ErrorKind::permission:
      return "DeniedError";
    case ErrorKind::unsupported:
      return "UnsupportedError";
  }
  return "Error";
}

void raise(const Error& error) {
  py::object holder = py::none();
  if (error.holder()) holder = py::make_tuple(error.holder()->pid, printable(error.holder()->name));
  const py::object made =
      py::module_::import("r4link.errors").attr("error_of")(*arguments_of(error.problem()), holder);
  PyErr_SetObject(reinterpret_cast<PyObject*>(Py_TYPE(made.ptr())), made.ptr());
}

}  // namespace

py::tuple arguments_of(const Problem& problem) {
  return py::make_tuple(error_class(problem.kind), printable(problem.thing),
                        printable(problem.reason), printable(problem.fix), problem.outcome,
                        problem.refusal, problem.at);
}

void bind_errors(py::module_&) {
  py::register_exception_translator([](std::exception_ptr pointer) {
    try {
      if (pointer) std::rethrow_exception(pointer);
    } catch (const Error& error) {
      raise(error);
    }
  });
}

}  // namespace r4::python
