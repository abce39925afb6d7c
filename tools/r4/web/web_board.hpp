// SPDX-License-Identifier: GPL-3.0-or-later
// A board in r4 web: watched, and controlled while a browser has control.
#pragma once

#include <asio/io_context.hpp>
#include <chrono>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "../boards/board_set.hpp"
#include "../devices/device_setup.hpp"
#include "r4link/async_board.hpp"
#include "r4link/recording.hpp"

namespace r4::tool::web {

constexpr std::chrono::milliseconds farewell_time{200};

class WebBoard {
 public:
  enum class Level : std::uint8_t { info, warning, error };
  class Events {
   public:
    virtual void on_state(std::size_t board, const ReceivedState& state,
                          const Datagram& datagram) = 0;
    // All other datagrams of the board.
    virtual void on_datagram(std::size_t board, const Datagram& datagram) = 0;
    virtual void on_change(std::size_t board) = 0;
    virtual void on_event(std::size_t board, Level level, const std::string& text) = 0;

   protected:
    ~Events() = default;
  };
  using Done = std::function<void()>;
  using OnResult = std::function<void(const CommandResult&)>;

  // Sets `devices` up while in control. The devices must outlive this object.
  WebBoard(asio::io_context& io, SetBoard& board, const std::vector<Device>& devices,
           Events& events);

  // Throws Error on failure, and the board stays watched.
  void take_control();
  // Stops the heartbeats. Calls `done` when the board is free or does not answer.
  void leave_control(Done done);
  void stop(OnResult done);

  AsyncBoard& board() { return board_; }
  const SetBoard& set_board() const { return set_; }
  bool controlling() const { return board_.role() == BoardRole::control; }
  const std::string& url() const { return set_.url; }
  const BoardIdentity& identity() const { return identity_; }

 private:
  void connect();
  void on_link(const LinkStatus& link);
  void say(Level level, const std::string& text) { events_.on_event(set_.index, level, text); }

  asio::io_context& io_;
  SetBoard& set_;
  const std::vector<Device>& devices_;
  Events& events_;
  AsyncBoard& board_{set_.board};
  std::optional<DeviceSetup> setup_;
  BoardIdentity identity_;
  LinkStatus link_;
  bool heard_ = false;
};

}  // namespace r4::tool::web
