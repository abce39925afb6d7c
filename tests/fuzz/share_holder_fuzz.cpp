// SPDX-License-Identifier: GPL-3.0-or-later
// Any number of programs connect to the holder of a shared transport, send any messages, read or do
// not read, and disconnect. Only the stops of these programs reach the board. A watcher receives
// everything, and the stop of the last program is obeyed. The input is a list of actions.
#include <fmt/format.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <asio/io_context.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/messages/command_field.hpp"
#include "r4link/datagram.hpp"
#include "tests/fuzz/input.hpp"
#include "transports/share/share_holder.hpp"
#include "transports/share/share_message.hpp"
#include "transports/share/share_socket.hpp"

namespace r4 {
namespace {

using Kind = ShareMessage::Kind;

constexpr std::string_view stop = "E:STOP;^0x506f0fbe^";
constexpr std::size_t most_connections = 60;

class Holder final : private ShareHolder::Owner {
 public:
  explicit Holder(bool gives_way) : gives_way_(gives_way) {
    require(holder_.hold(name, BoardRole::watch));
    watcher_ = come(Kind::hello, ShareMessage::version);
    run();
    require(holder_.served() == 1);
    hear();
  }
  ~Holder() {
    holder_.release();
    run();
  }

  void act(Input& input) {
    const std::uint8_t action = input.byte();
    FileDescriptor none;
    FileDescriptor& one = others_.empty() ? none : others_[input.byte() % others_.size()];
    switch (action % 8) {
      case 0:
        if (others_.size() < most_connections)
          others_.push_back(connect_to_holder(name, BoardRole::watch));
        break;
      case 1:
        say(one, Kind::hello, ShareMessage::version);
        break;
      case 2:
        say(one, Kind::ask, ShareMessage::version);
        break;
      case 3:
        say(one, Kind::stop, stop);
        break;
      case 4: {
        std::string bytes;
        for (std::size_t left = input.byte(); left > 0; --left)
          bytes += static_cast<char>(input.byte());
        if (action & 0x80) bytes.resize(bytes.size() * 16, 'x');
        ::send(one.get(), bytes.data(), bytes.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
        break;
      }
      case 5:
        one.reset();
        break;
      case 6:
        holder_.tell(Kind::received, "AIN24:24.28;");
        told_ += given_away_ ? 0 : 1;
        hear();
        break;
      default:
        break;
    }
    if (action & 0x40) return;  // the holder runs after a later action
    run();
    hear();
  }

  void end() {
    run();
    run_until([] { return false; });  // the holder accepts the waiting programs one after another
    if (given_away_) return;
    const int before = stops_;
    const FileDescriptor last = come(Kind::stop, stop);
    run_until([&] { return stops_ != before; });
    require(stops_ == before + 1);
    hear();
  }

 private:
  std::vector<CarrierEvent> standing() const override {
    return {{CarrierEvent::Kind::up, {ErrorKind::open, name.text, "", ""}}};
  }
  void on_stop_of_another(std::string_view bytes) override {
    Datagram datagram;
    require(read_datagram(Text(bytes.data(), bytes.size()), datagram) && asks_to_stop(datagram));
    require(!given_away_);
    ++stops_;
  }
  void on_asked() override {
    if (!gives_way_) return;
    given_away_ = true;
    holder_.release();
  }

  static FileDescriptor come(Kind kind, std::string_view text) {
    FileDescriptor connection = connect_to_holder(name, BoardRole::watch);
    require(static_cast<bool>(connection));
    say(connection, kind, text);
    return connection;
  }
  static void say(const FileDescriptor& connection, Kind kind, std::string_view text) {
    if (connection) send_message(connection.get(), kind, text);
  }
  // Runs events until `done`, or until nothing happens for the time of ten arrivals.
  template <class Done>
  void run_until(Done done) {
    for (std::size_t event = 0; event < 100 * most_connections && !done(); ++event) {
      io.restart();
      if (io.run_one_for(10 * ShareHolder::between_arrivals) == 0) return;
    }
  }
  void run() {
    io.restart();
    io.poll();
    require(holder_.served() <= ShareHolder::most_served_after_a_stop);
  }
  void hear() {
    std::array<char, ShareMessage::max_size + 1> packet;
    while (true) {
      const ssize_t size = ::recv(watcher_.get(), packet.data(), packet.size(), MSG_TRUNC);
      if (size <= 0) break;
      const auto message = read_share_message({packet.data(), static_cast<std::size_t>(size)});
      require(message &&
              (message->kind != Kind::event || message->event.kind == CarrierEvent::Kind::up));
      told_ -= message->kind == Kind::received ? 1 : 0;
    }
    require(told_ == 0);
  }

  static inline asio::io_context io{1};
  static inline const ShareName name{fmt::format("fuzz/{}", ::getpid())};

  const bool gives_way_;
  bool given_away_ = false;
  int stops_ = 0;
  int told_ = 0;  // sent to the watcher and not yet received
  ShareHolder holder_{io, *this};
  FileDescriptor watcher_;
  std::vector<FileDescriptor> others_;
};

}  // namespace
}  // namespace r4

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  r4::Input input(data, size);
  r4::Holder holder(input.byte() % 2 != 0);
  for (int i = 0; i < 200 && !input.empty(); ++i) holder.act(input);
  holder.end();
  return 0;
}
