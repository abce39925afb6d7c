// SPDX-License-Identifier: GPL-3.0-or-later
#include "board_search.hpp"

#include <fmt/format.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <asio/ip/udp.hpp>
#include <cerrno>
#include <cstring>
#include <optional>
#include <set>
#include <utility>

#include "../../file_descriptor.hpp"
#include "../network/udp_route.hpp"
#include "r4link/datagram.hpp"
#include "r4link/discovery/url.hpp"

namespace r4 {
namespace {

using asio::ip::address_v4;
using Endpoint = asio::ip::udp::endpoint;
using Network = BoardSearch::Network;
using Clock = std::chrono::steady_clock;

constexpr std::size_t most_networks = 64;
// Datagrams read from one socket before the next socket is read and the time checked.
constexpr int most_at_once = 64;
constexpr std::size_t most_listed = 8;  // boards in an error; `r4 list` shows all of them

// Sends by the network's own interface. If it is not open, `network.trouble` has the reason.
FileDescriptor open_in(Network& network) {
  FileDescriptor socket(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  const int on = 1;
  const std::uint32_t index = htonl(network.index);
  const Endpoint from(network.from, 0);
  if (!socket || ::setsockopt(socket.get(), SOL_SOCKET, SO_BROADCAST, &on, sizeof on) != 0 ||
      ::setsockopt(socket.get(), IPPROTO_IP, IP_UNICAST_IF, &index, sizeof index) != 0 ||
      ::bind(socket.get(), from.data(), static_cast<socklen_t>(from.size())) != 0) {
    network.trouble = std::strerror(errno);
    return FileDescriptor();
  }
  return socket;
}

class Round {
 public:
  Round(const BoardSearch& search, std::string_view called) : search_(search), called_(called) {
    result_.networks = search.networks();
    for (Network& network : result_.networks) {
      sockets_.push_back(open_in(network));
      polled_.push_back({sockets_.back().get(), POLLIN, 0});
    }
  }

  BoardSearch::Result run() {
    const std::string text = identity_question();
    const auto end = Clock::now() + search_.patience;
    for (int left = search_.questions; left > 0; --left) {
      ask_all(text);
      hear_until(left == 1 ? end : std::min(end, Clock::now() + search_.between));
    }
    merge_own();
    result_.others = others_.size();
    return std::move(result_);
  }

 private:
  void hear_until(Clock::time_point end) {
    for (auto now = Clock::now(); now < end; now = Clock::now()) {
      const auto wait = std::chrono::ceil<std::chrono::milliseconds>(end - now).count();
      if (::poll(polled_.data(), polled_.size(), static_cast<int>(wait)) <= 0) continue;
      for (std::size_t i = 0; i < polled_.size(); ++i) {
        if (polled_[i].revents != 0) hear(i);
      }
    }
  }

  void ask_all(const std::string& text) {
    for (std::size_t i = 0; i < sockets_.size(); ++i) {
      if (!sockets_[i]) continue;
      const int socket = sockets_[i].get();
      Network& network = result_.networks[i];
      const Endpoint to(network.to, search_.port);
      const bool sent = ::sendto(socket, text.data(), text.size(), MSG_DONTWAIT | MSG_NOSIGNAL,
                                 to.data(), static_cast<socklen_t>(to.size())) >= 0;
      network.trouble = sent ? "" : std::strerror(errno);
    }
  }

  void hear(std::size_t which) {
    for (int i = 0; i < most_at_once; ++i) {
      Endpoint from;
      auto from_size = static_cast<socklen_t>(from.size());
      const ssize_t size = ::recvfrom(sockets_[which].get(), buffer_.data(), buffer_.size(),
                                      MSG_DONTWAIT | MSG_TRUNC, from.data(), &from_size);
      if (size < 0) return;
      // A board answers from the port at which it listens.
      if (from.port() != search_.port || static_cast<std::size_t>(size) > max_datagram) continue;
      std::optional<IdentityAnswer> answer =
          read_identity_answer(Text(buffer_.data(), static_cast<std::size_t>(size)));
      if (!answer) continue;
      keep({std::move(*answer), from.address().to_v4(), result_.networks[which].from});
    }
  }

  void keep(AnsweredBoard board) {
    if (!called_.empty() && board.board_id != called_ && board.name != called_) {
      others_.insert(board.board_id);
      if (others_.size() > BoardSearch::most_boards) others_.erase(others_.begin());
      return;
    }
    for (const AnsweredBoard& known : result_.boards) {
      if (known.address == board.address) return;
    }
    result_.more = result_.boards.size() == BoardSearch::most_boards;
    if (!result_.more) result_.boards.push_back(std::move(board));
  }

  bool is_own(const address_v4& address) const {
    return std::any_of(result_.networks.begin(), result_.networks.end(),
                       [&](const Network& network) { return network.from == address; });
  }

  // A simulated board that listens on all addresses of this computer answers from each address.
  void merge_own() {
    std::set<std::string> kept;
    std::erase_if(result_.boards, [&](const AnsweredBoard& board) {
      return is_own(board.address) && !kept.insert(board.board_id).second;
    });
  }

  const BoardSearch& search_;
  const std::string_view called_;
  std::set<std::string> others_;  // ids: one board may answer from several addresses
  BoardSearch::Result result_;
  std::vector<FileDescriptor> sockets_;
  std::vector<pollfd> polled_;
  std::array<char, max_datagram + 1> buffer_;
};

Problem nothing_found(const BoardSearch::Result& result, const WantedBoard& wanted) {
  std::set<std::string> interfaces;  // an interface may have several addresses
  std::string trouble;
  for (const Network& network : result.networks) {
    if (network.trouble.empty()) interfaces.insert(network.interface);
    if (!network.trouble.empty()) trouble = network.interface + ": " + network.trouble;
  }
  const std::string asked = fmt::format("{}", fmt::join(interfaces, ", "));
  if (asked.empty()) {
    return {ErrorKind::open, "",
            trouble.empty() ? "this computer is not connected to a network"
                            : fmt::format("nothing can be sent ({})", trouble),
            "connect this computer to the board's network"};
  }
  return {ErrorKind::open, "",
          wanted.called.empty()
              ? fmt::format("no R4 board answered (asked on {})", asked)
              : fmt::format("no board named '{}' answered, but {} other board{} did (asked on {})",
                            wanted.called, result.others, result.others == 1 ? "" : "s", asked),
          "switch the board on and connect to its network; if broadcast does not pass, give its "
          "address, as in udp://192.168.1.77"};
}

Problem several_found(const std::vector<AnsweredBoard>& boards, const WantedBoard& wanted,
                      const BoardSearch::Result& result, std::uint16_t port) {
  std::string list;
  for (std::size_t i = 0; i < boards.size() && i < most_listed; ++i) {
    list += fmt::format("{}{} ({})", i == 0 ? "" : ", ", url_of(boards[i], result.boards, port),
                        boards[i].address.to_string());
  }
  if (boards.size() > most_listed || result.more) list += ", …; r4 list shows more";
  return {ErrorKind::usage, "",
          wanted.called.empty() ? "several boards answered"
                                : fmt::format("several boards are named '{}'", wanted.called),
          "use one of " + list};
}

}  // namespace

std::vector<Network> BoardSearch::networks_of_this_computer() {
  std::vector<Network> networks;
  for (OwnAddress& own : own_addresses()) {
    if (!own.works || own.broadcast.is_unspecified() || networks.size() == most_networks) continue;
    networks.push_back({std::move(own.name), own.interface, own.address.to_v4(), own.broadcast});
  }
  return networks;
}

BoardSearch::Result BoardSearch::run(std::string_view called) const {
  return Round(*this, called).run();
}

std::vector<AnsweredBoard> called(const std::vector<AnsweredBoard>& boards,
                                  std::string_view id_or_name) {
  std::vector<AnsweredBoard> by_id;
  std::vector<AnsweredBoard> by_name;
  for (const AnsweredBoard& board : boards) {
    if (board.board_id == id_or_name) by_id.push_back(board);
    if (board.name == id_or_name) by_name.push_back(board);
  }
  return by_id.empty() ? by_name : by_id;
}

std::string url_of(const AnsweredBoard& board, const std::vector<AnsweredBoard>& boards,
                   std::uint16_t port) {
  for (const std::string& text : {board.name, board.board_id}) {
    if (text.empty()) continue;
    const std::vector<AnsweredBoard> meant = called(boards, text);
    if (meant.size() != 1 || meant.front().address != board.address) continue;
    const std::string url = "udp:?id=" + percent_encoded(text);
    return port == BoardSearch().port ? url : fmt::format("{}&port={}", url, port);
  }
  const std::string url = "udp://" + board.address.to_string();
  return port == BoardSearch().port ? url : fmt::format("{}:{}", url, port);
}

FoundHost find_board(const BoardSearch& search, const WantedBoard& wanted) {
  const BoardSearch::Result result =
      search.run(wanted.called.empty() ? wanted.board_id : wanted.called);
  std::vector<AnsweredBoard> meant = result.boards;
  if (!wanted.called.empty()) meant = called(result.boards, wanted.called);
  if (!wanted.board_id.empty()) {
    // If the URL names no board, or the board found before has the name in the URL, only the board
    // found before is meant.
    std::vector<AnsweredBoard> same = meant;
    std::erase_if(same,
                  [&](const AnsweredBoard& each) { return each.board_id != wanted.board_id; });
    if (!same.empty() || wanted.called.empty()) meant = std::move(same);
  }
  FoundHost found;
  if (meant.empty()) {
    found.problem = nothing_found(result, wanted);
  } else if (meant.size() > 1) {
    found.problem = several_found(meant, wanted, result, search.port);
  }
  for (const AnsweredBoard& board : meant) found.addresses.emplace_back(board.address);
  if (!meant.empty()) found.board_id = meant.front().board_id;
  return found;
}

}  // namespace r4
