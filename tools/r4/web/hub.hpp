// SPDX-License-Identifier: GPL-3.0-or-later
// Connects the boards and the server's clients, whose messages arrive parsed, on the boards' loop.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "../boards/board_set.hpp"
#include "columns.hpp"
#include "control.hpp"
#include "foxglove.hpp"
#include "messages.hpp"
#include "page_request.hpp"
#include "r4link/control/boot_clock.hpp"
#include "server/server.hpp"
#include "web_board.hpp"
#include "web_recording.hpp"

namespace r4::tool::web {

struct HubOptions {
  ServerOptions server;
  std::string record_folder;
  std::vector<Device> devices;
};

class Hub final : ServerEvents, WebBoard::Events {
 public:
  // The boards, not yet open, must outlive the hub. Throws Error if the hub cannot listen.
  Hub(BoardSet& boards, const HubOptions& options);
  ~Hub();

  void start();
  const ListenAddress& address() const { return server_.address(); }
  void end();

 private:
  // On the server's thread:
  void on_open(ClientId client, Protocol protocol) override;
  void on_message(ClientId client, Protocol protocol, std::string text) override;
  void on_closed(ClientId client, Protocol protocol) override;
  void on_metrics() override;

  // On the loop:
  void on_state(std::size_t board, const ReceivedState& state, const Datagram& datagram) override;
  void on_datagram(std::size_t board, const Datagram& datagram) override;
  void on_change(std::size_t board) override;
  void on_event(std::size_t board, WebBoard::Level level, const std::string& text) override;

  void greet(ClientId client);
  void leave(ClientId client);
  void obey(ClientId client, const PageRequest& request);
  void want_control(ClientId client, bool wanted);
  void end_control(const std::string& why);
  void watch_holder();
  void look_at_holder();
  void tell_control(const std::string& why);
  void tell_control(ClientId client, const std::string& why);
  void record(ClientId client, bool on);
  void command(ClientId client, const PageRequest& request);
  void send(ClientId client, const PageRequest& request, AsyncBoard& board,
            const std::string& text);
  void stop(ClientId client, const PageRequest& request);
  void answer(ClientId client, const PageRequest& request, std::size_t board, bool ok, double ms,
              const std::string& text);
  template <class What>  // a command, a group, or the name of another request
  WebBoard::OnResult answering(ClientId client, const PageRequest& request, std::size_t board,
                               What what);
  void tell(ClientId client, std::string text);
  void tell_all(std::string text, Outgoing::Kind kind = Outgoing::Kind::other);
  void tell_recording();
  void tell_recording(ClientId client, const std::string& why);
  void tick();
  void tell_states();
  void tell_board(std::size_t board);
  Control::Time now() const;

  asio::io_context& io_;
  const BootClock::time_point began_ = BootClock::now();
  const std::vector<Device> devices_;
  const Columns columns_;
  std::vector<std::unique_ptr<WebBoard>> boards_;
  std::vector<WebBoard*> all_;
  std::vector<Rows> rows_;
  std::vector<bool> changed_;
  std::set<ClientId> pages_;
  Control control_;
  Timer tick_;
  Timer deadline_;
  Control::Time told_states_{0};
  Control::Time next_second_{0};
  bool closing_ = false;
  WebRecording recording_;
  Foxglove foxglove_;
  Server server_;
};

}  // namespace r4::tool::web
