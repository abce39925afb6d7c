// SPDX-License-Identifier: GPL-3.0-or-later
// Reads the fields of a datagram once, in wire order, faster than Datagram::Iterator with
// parse_number(). Relies on the grammar, which read_datagram() has checked: ':' is after each name,
// ';' after each field, '^' after the last field.
//     for (FieldReader reader(datagram); !reader.at_end();) {
//       bool ok = true;
//       if (reader.take_name("OSMC1")) {
//         ok = reader.take(4095, pwm) && reader.take(',') && reader.take(1, direction);
//       } else {
//         reader.take_name();      // passes any other field
//         reader.take_values();
//       }
//       if (!ok || !reader.take(';')) return false;  // a value is missing, wrong or surplus
//     }
// take_name(name) may return false. If take() or take_hundredths() returns false, end the loop.
#pragma once

#include <cstddef>
#include <cstdint>

#include "numbers.hpp"
#include "r4link/datagram.hpp"

namespace r4 {

class FieldReader {
 public:
  explicit FieldReader(const Datagram& datagram)
      : at_(datagram.bytes().empty() ? "^" : datagram.bytes().begin()),
        end_(datagram.bytes().end()) {}

  bool at_end() const { return *at_ == '^'; }

  // True if the next field has that name: then its values are next. Otherwise nothing is taken.
  bool take_name(Text name) {
    if (static_cast<std::size_t>(end_ - at_) <= name.size() || at_[name.size()] != ':' ||
        Text(at_, name.size()) != name) {
      return false;
    }
    at_ += name.size() + 1;
    return true;
  }
  Text take_name() {
    const Text name = up_to(':');
    ++at_;
    return name;
  }
  // The values that are left in the field, with the commas.
  Text take_values() { return up_to(';'); }

  bool take(char separator) {
    const bool found = *at_ == separator;
    at_ += found ? 1 : 0;
    return found;
  }
  // `Member` must hold 0 to `limit`.
  template <class Member>
  bool take(std::uint32_t limit, Member& out) {
    std::uint32_t value = 0;
    if (!take_number(at_, value) || value > limit) return false;
    out = static_cast<Member>(value);
    return true;
  }
  bool take(std::int32_t& out) { return take_number(at_, out); }
  bool take_hundredths(std::int32_t& out) { return r4::take_hundredths(at_, out); }

 private:
  Text up_to(char separator) {
    const char* const first = at_;
    while (*at_ != separator) ++at_;
    return Text(first, static_cast<std::size_t>(at_ - first));
  }

  const char* at_;
  const char* end_;
};

}  // namespace r4
