// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "pickle.hpp"

namespace r4::python {

// A small value for Python, with its members as attributes and as a dict.
template <class Value>
class Record {
 public:
  Record(py::module_& module, const char* name) : class_(module, name) {
    class_.def(pickled<Value>(name));
    class_.def("as_dict", [members = members_](const py::object& self) {
      py::dict dict;
      for (const py::handle member : members) dict[member] = self.attr(member);
      return dict;
    });
    class_.def("__repr__", [](const py::object& self) {
      py::list parts;
      const py::dict dict = self.attr("as_dict")();
      for (const auto& [member, value] : dict) {
        parts.append(py::str("{}={!r}").format(member, value));
      }
      return py::str("{}({})").format(py::type::of(self).attr("__name__"),
                                      py::str(", ").attr("join")(parts));
    });
  }
  template <class Getter>
  Record& has(const char* member, Getter getter) {
    members_.append(member);
    class_.def_property_readonly(member, getter);
    return *this;
  }
  template <class Member>
  Record& has(const char* member, Member Value::*which) {
    return has(member, [which](const Value& value) { return value.*which; });
  }

 private:
  py::class_<Value> class_;
  py::list members_;  // shared with as_dict
};

}  // namespace r4::python
