// SPDX-License-Identifier: GPL-3.0-or-later
// Enumerations for Python: each C++ enumerator is the member of r4link/enums.py with its text.
#pragma once

#include <pybind11/pybind11.h>

#include <cstdint>
#include <string>
#include <vector>

#include "r4link/control/loop.hpp"
#include "r4link/devices/description.hpp"
#include "r4link/fleet.hpp"

// EACH(class in Python, type in C++). For a PostResult, the value() is converted.
#define R4_ENUMS(EACH)                       \
  EACH(BoardRole, r4::BoardRole)             \
  EACH(DeviceRole, r4::DeviceRole)           \
  EACH(DisarmCause, r4::DisarmCause)         \
  EACH(EventKind, r4::CarrierEvent::Kind)    \
  EACH(FleetEventKind, r4::FleetEvent::Kind) \
  EACH(I2cOutcome, r4::I2cOutcome)           \
  EACH(LinkCause, r4::LinkCause)             \
  EACH(LinkState, r4::HostLinkState)         \
  EACH(LoopEnd, r4::control::LoopEnd)        \
  EACH(Outcome, r4::Outcome)                 \
  EACH(PathState, r4::PathState)             \
  EACH(PostResult, r4::PostResult::Value)    \
  EACH(Refusal, r4::Refusal)                 \
  EACH(SafeReason, r4::SafeReason)

namespace r4::python {

// An enumeration of r4link/enums.py. All functions need the GIL.
class PythonEnum {
 public:
  using WordOf = std::string (*)(std::uint8_t number);

  // Throws if Python lacks an enumerator. A number without an enumerator has the text of 255.
  PythonEnum(const char* name, WordOf word_of);

  // Throws if no member has the number's text: newer firmware may send another number.
  pybind11::handle member(std::uint8_t number) const;
  // Takes a member or its text. Throws for anything else.
  std::uint8_t number(pybind11::handle word) const;
  pybind11::tuple members() const;

 private:
  pybind11::handle class_;
  std::string other_;                      // the text of a number without an enumerator
  std::vector<pybind11::handle> members_;  // kept as long as the interpreter
};

inline std::string word_of(Refusal refusal) {
  const Text name = name_of(refusal);
  return {name.data(), name.size()};
}
template <class Enum>
std::string word_of(Enum value) {
  return to_text(value);
}

template <class Enum>
const PythonEnum& python_enum(const char* name) {
  static const PythonEnum found(
      name, [](std::uint8_t number) { return word_of(static_cast<Enum>(number)); });
  return found;
}

}  // namespace r4::python

#define R4_CASTER(name_in_python, Enum)                                      \
  template <>                                                                \
  class pybind11::detail::type_caster<Enum> {                                \
   public:                                                                   \
    static handle cast(Enum value, return_value_policy, handle) {            \
      return in_python().member(static_cast<std::uint8_t>(value)).inc_ref(); \
    }                                                                        \
    bool load(handle word, bool) {                                           \
      value = static_cast<Enum>(in_python().number(word));                   \
      return true;                                                           \
    }                                                                        \
    PYBIND11_TYPE_CASTER(Enum, const_name(#name_in_python));                 \
                                                                             \
   private:                                                                  \
    static const r4::python::PythonEnum& in_python() {                       \
      return r4::python::python_enum<Enum>(#name_in_python);                 \
    }                                                                        \
  };
R4_ENUMS(R4_CASTER)
#undef R4_CASTER
