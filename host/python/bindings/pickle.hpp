// SPDX-License-Identifier: GPL-3.0-or-later
// Pickles values for other processes of a program. Only the same version reads them.
#pragma once

#include <cstddef>
#include <cstring>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "bindings.hpp"
#include "r4link/commands/command_text.hpp"
#include "r4link/discovery/discover.hpp"
#include "r4link/fleet.hpp"

namespace r4::python {

class Pickle {
 public:
  Pickle() = default;
  explicit Pickle(std::string_view bytes) : reads_(true), bytes_(bytes) {}

  template <class... Members>
  void operator()(Members&... members) {
    (one(members), ...);
  }
  const std::string& bytes() const { return bytes_; }
  bool whole() const { return whole_ && at_ == bytes_.size(); }

 private:
  void raw(void* member, std::size_t size) {
    if (!reads_) {
      bytes_.append(static_cast<const char*>(member), size);
    } else if (bytes_.size() - at_ < size) {
      whole_ = false;
    } else {
      std::memcpy(member, bytes_.data() + at_, size);
      at_ += size;
    }
  }
  std::size_t count(std::size_t size) {
    raw(&size, sizeof size);
    return !reads_ || (whole_ && size <= bytes_.size()) ? size : 0;
  }

  template <class Member>
  void one(Member& member) {
    if constexpr (std::is_trivially_copyable_v<Member>) {
      raw(static_cast<void*>(&member), sizeof member);
    } else {
      members_of(*this, member);
    }
  }
  void one(std::string& text) {
    text.resize(count(text.size()));
    raw(text.data(), text.size());
  }
  template <class Member>
  void one(std::vector<Member>& all) {
    all.resize(count(all.size()));
    for (Member& each : all) one(each);
  }
  template <class Member>
  void one(std::optional<Member>& some) {
    bool has = some.has_value();
    one(has);
    if (has && !some) some.emplace();
    if (has) one(*some);
  }
  void one(OwnCommand& own) {
    Command command = own;
    std::string text(command.text.data(), command.text.size());
    std::string text2(command.text2.data(), command.text2.size());
    command.text = command.text2 = Text();
    raw(static_cast<void*>(&command), sizeof command);
    one(text);
    one(text2);
    command.text = text;
    command.text2 = text2;
    own = OwnCommand(command);
  }

  bool reads_ = false;
  bool whole_ = true;
  std::string bytes_;
  std::size_t at_ = 0;
};

inline void members_of(Pickle& pickle, Problem& it) {
  pickle(it.kind, it.thing, it.reason, it.fix, it.outcome, it.refusal, it.at);
}
inline void members_of(Pickle& pickle, CarrierEvent& it) { pickle(it.kind, it.problem); }
inline void members_of(Pickle& pickle, BoardIdentity& it) {
  pickle(it.firmware, it.board_id, it.capabilities, it.name);
}
inline void members_of(Pickle& pickle, PathStatus& it) {
  pickle(it.name, it.state, it.busy, it.board_id, it.packets, it.copies, it.round_trip_us,
         it.age_us);
}
inline void members_of(Pickle& pickle, BoardHealth& it) {
  pickle(it.board, it.url, it.identity, it.link, it.in_control, it.disarmed_by, it.statistics,
         it.paths);
}
inline void members_of(Pickle& pickle, Program& it) { pickle(it.pid, it.name); }
inline void members_of(Pickle& pickle, FoundBoard& it) {
  pickle(it.url, it.place, it.address, it.node, it.identity, it.busy, it.holder, it.holder_controls,
         it.foreign_frames);
}
inline void members_of(Pickle& pickle, SearchedPort& it) {
  pickle(it.path, it.url, it.usb_id, it.serial_number, it.description, it.is_r4, it.asked,
         it.trouble);
}
inline void members_of(Pickle& pickle, SearchedBus& it) {
  pickle(it.interface, it.up, it.fd, it.has_controller, it.state, it.bit_rate, it.trouble);
}
inline void members_of(Pickle& pickle, SearchedNetwork& it) {
  pickle(it.interface, it.address, it.trouble);
}
inline void members_of(Pickle& pickle, Discovery& it) {
  pickle(it.boards, it.ports, it.buses, it.networks, it.more);
}
inline void members_of(Pickle& pickle, FleetResult& it) { pickle(it.board, it.result, it.problem); }

template <class Value>
Value blank() {
  return Value{};
}

template <class Value>
auto pickled(const char* name) {
  return py::pickle(
      [](const Value& value) {
        Value copy = value;
        Pickle pickle;
        pickle(copy);
        return py::make_tuple(R4LINK_VERSION, sizeof(Value), py::bytes(pickle.bytes()));
      },
      [name](const py::tuple& told) {
        const bool same = told.size() == 3 && told[0].cast<std::string>() == R4LINK_VERSION &&
                          told[1].cast<std::size_t>() == sizeof(Value);
        Pickle pickle(same ? told[2].cast<std::string>() : std::string());
        Value value = blank<Value>();
        pickle(value);
        if (same && pickle.whole()) return value;
        throw Error(ErrorKind::data, name, "the object was pickled by another version of R4 link",
                    "use the same version in all processes");
      });
}

}  // namespace r4::python
