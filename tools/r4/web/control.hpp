// SPDX-License-Identifier: GPL-3.0-or-later
// Decides which browser controls the boards, and for how long: without a browser no motor turns.
//      free --take()--> held --release() of its holder, or expired()--> leaving --left()--> free
// The holder sends alive() ten times a second, with the newest server time it has received. Control
// expires when the newest echoed time is `limit` old, so silence or delayed messages end control.
// Messages arrive in order, so no older command is accepted. The caller passes in the time.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>

namespace r4::tool::web {

class Control {
 public:
  using Time = std::chrono::milliseconds;
  using Client = std::uint32_t;
  static constexpr std::chrono::milliseconds limit{500};

  std::optional<Client> holder() const { return holder_; }
  bool is_held_by(Client client) const { return holder_ == client; }
  bool leaving() const { return leaving_; }

  bool take(Client client, Time now);
  bool release(Client client);
  // Call when all boards have been left.
  void left() { leaving_ = false; }
  // False if `echoed` is not newer than before.
  bool alive(Client client, Time echoed, Time now);
  std::optional<Time> deadline() const;
  bool expired(Time now) const { return holder_ && now >= *deadline(); }

 private:
  std::optional<Client> holder_;
  bool leaving_ = false;
  Time last_{0};
};

}  // namespace r4::tool::web
