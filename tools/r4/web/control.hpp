// SPDX-License-Identifier: GPL-3.0-or-later
// Which browser controls the boards, and for how long: no browser, no motor.
//
//      free --take()--> held --release() of its holder, or expired()--> leaving --left()--> free
//
// While it is held, its holder says that it is alive, ten times a second, with the newest time that it was told. It is
// over when the newest of these echoes is `limit` old: so neither silence nor words that were held up on the way keep
// it, and since words come in order, no command is taken that was sent before something that old. Time is passed in.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>

namespace r4::tool::web {

class Control {
 public:
  using Time = std::chrono::milliseconds;  // any start
  using Client = std::uint32_t;
  static constexpr std::chrono::milliseconds limit{500};

  std::optional<Client> holder() const { return holder_; }
  bool is_held_by(Client client) const { return holder_ == client; }
  bool leaving() const { return leaving_; }

  // False: another has it, or has not quite left it.
  bool take(Client client, Time now);
  // False: it was not the holder.
  bool release(Client client);
  // Everybody has heard that it is over.
  void left() { leaving_ = false; }
  // False where it tells nothing newer.
  bool alive(Client client, Time echoed, Time now);
  // When it ends unless alive() counts before.
  std::optional<Time> deadline() const;
  bool expired(Time now) const { return holder_ && now >= *deadline(); }

 private:
  std::optional<Client> holder_;
  bool leaving_ = false;
  Time last_{0};
};

}  // namespace r4::tool::web
