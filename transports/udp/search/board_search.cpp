// SPDX-License-Identifier: GPL-3.0-or-later
#include "board_search.hpp"

#include <fmt/format.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <memory>
#include <optional>
#include <set>
#include <utility>

#include "../../file_descriptor.hpp"
#include "r4link/datagram.hpp"
#include "r4link/discovery/url.hpp"

namespace r4 {
namespace {

using asio::ip::address_v4;
using Network = BoardSearch::Network;
using Clock = std::chrono::steady_clock;

constexpr std::size_t most_networks = 64;
// Datagrams read from one socket before the next socket is read and the time checked.
constexpr int most_at_once = 64;
constexpr std::size_t most_listed = 8;  // boards in an error; `r4 list` shows all of them

sockaddr_in system_address(const address_v4& address, std::uint16_t port) {
  sockaddr_in system{};
  system.sin_family = AF_INET;
  system.sin_port = htons(port);
  system.sin_addr.s_addr = htonl(address.to_uint());
  return system;
}

address_v4 address_of(const sockaddr* system) {
  sockaddr_in in{};
  std::memcpy(&in, system, sizeof in);
  return address_v4(ntohl(in.sin_addr.s_addr));
}

// Sends by the network's own interface. If it is not open, `network.trouble` has the reason.
FileDescriptor open_in(Network& network) {
  FileDescriptor socket(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  const int on = 1;
  const std::uint32_t index = htonl(network.index);
  const sockaddr_in from = system_address(network.from, 0);
  if (!socket || ::setsockopt(socket.get(), SOL_SOCKET, SO_BROADCAST, &on, sizeof on) != 0 ||
      ::setsockopt(socket.get(), IPPROTO_IP, IP_UNICAST_IF, &index, sizeof index) != 0 ||
      ::bind(socket.get(), reinterpret_cast<const sockaddr*>(&from), sizeof from) != 0) {
    network.trouble = std::strerror(errno);
    return FileDescriptor();
  }
  return socket;
}

void ask(int socket, Network& network, std::uint16_t port, const std::string& text) {
  const sockaddr_in to = system_address(network.to, port);
  const bool sent = ::sendto(socket, text.data(), text.size(), MSG_DONTWAIT | MSG_NOSIGNAL,
                             reinterpret_cast<const sockaddr*>(&to), sizeof to) >= 0;
  network.trouble = sent ? "" : std::strerror(errno);
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
    const auto begun = Clock::now();
    const auto end = begun + search_.patience;
    auto next_question = begun;
    int asked = 0;
    for (auto now = begun; now < end; now = Clock::now()) {
      if (asked < search_.questions && now >= next_question) {
        ask_all(text);
        ++asked;
        next_question = now + search_.between;
      }
      const auto until = asked < search_.questions ? std::min(end, next_question) : end;
      const auto wait = std::chrono::ceil<std::chrono::milliseconds>(until - now).count();
      if (::poll(polled_.data(), polled_.size(), wait > 0 ? static_cast<int>(wait) : 0) <= 0) {
        continue;
      }
      for (std::size_t i = 0; i < polled_.size(); ++i) {
        if (polled_[i].revents != 0) hear(i);
      }
    }
    merge_own();
    result_.others = others_.size();
    return std::move(result_);
  }

 private:
  void ask_all(const std::string& text) {
    for (std::size_t i = 0; i < sockets_.size(); ++i) {
      if (sockets_[i]) ask(sockets_[i].get(), result_.networks[i], search_.port, text);
    }
  }

  void hear(std::size_t which) {
    for (int i = 0; i < most_at_once; ++i) {
      sockaddr_in from{};
      socklen_t from_size = sizeof from;
      const ssize_t size =
          ::recvfrom(sockets_[which].get(), buffer_.data(), buffer_.size(),
                     MSG_DONTWAIT | MSG_TRUNC, reinterpret_cast<sockaddr*>(&from), &from_size);
      if (size < 0) return;
      // A board answers from the port at which it listens.
      if (ntohs(from.sin_port) != search_.port || static_cast<std::size_t>(size) > max_datagram) {
        continue;
      }
      std::optional<IdentityAnswer> answer =
          read_identity_answer(Text(buffer_.data(), static_cast<std::size_t>(size)));
      if (!answer) continue;
      AnsweredBoard board{std::move(*answer), {}, {}};
      board.address = address_v4(ntohl(from.sin_addr.s_addr));
      board.heard_at = result_.networks[which].from;
      keep(std::move(board));
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
    if (result_.boards.size() == BoardSearch::most_boards) {
      result_.more = true;
      return;
    }
    result_.boards.push_back(std::move(board));
  }

  bool is_own(const address_v4& address) const {
    return std::any_of(result_.networks.begin(), result_.networks.end(),
                       [&](const Network& network) { return network.from == address; });
  }

  // A simulated board that listens on all addresses of this computer answers from each address.
  void merge_own() {
    std::vector<AnsweredBoard>& boards = result_.boards;
    for (std::size_t i = 0; i < boards.size(); ++i) {
      if (!is_own(boards[i].address)) continue;
      const auto same = [&](const AnsweredBoard& other) {
        return other.board_id == boards[i].board_id && is_own(other.address);
      };
      const auto after = boards.begin() + static_cast<std::ptrdiff_t>(i) + 1;
      boards.erase(std::remove_if(after, boards.end(), same), boards.end());
    }
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
  std::vector<std::string> interfaces;  // each once; an interface may have several addresses
  std::string trouble;
  for (const Network& network : result.networks) {
    if (!network.trouble.empty()) {
      trouble = network.interface + ": " + network.trouble;
    } else if (std::find(interfaces.begin(), interfaces.end(), network.interface) ==
               interfaces.end()) {
      interfaces.push_back(network.interface);
    }
  }
  const std::string asked = fmt::format("{}", fmt::join(interfaces, ", "));
  if (asked.empty()) {
    return {ErrorKind::open, "",
            trouble.empty() ? "this computer is in no network"
                            : fmt::format("nothing can be sent ({})", trouble),
            "join the network of the board"};
  }
  return {
      ErrorKind::open, "",
      wanted.called.empty()
          ? fmt::format("no R4 board answered (asked on {})", asked)
          : fmt::format("no board called '{}' answered, {} other{} did (asked on {})",
                        wanted.called, result.others, result.others == 1 ? "" : "s", asked),
      "switch it on and join its network; where broadcast does not pass, give its address as in "
      "udp://192.168.1.77"};
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
                                : fmt::format("several boards are called '{}'", wanted.called),
          "use one of " + list};
}

}  // namespace

std::vector<Network> BoardSearch::networks_of_this_computer() {
  std::vector<Network> networks;
  ifaddrs* first = nullptr;
  if (::getifaddrs(&first) != 0) return networks;
  const std::unique_ptr<ifaddrs, decltype(&::freeifaddrs)> all(first, &::freeifaddrs);
  for (const ifaddrs* each = first; each != nullptr; each = each->ifa_next) {
    const bool is_running = (each->ifa_flags & IFF_UP) != 0 && (each->ifa_flags & IFF_RUNNING) != 0;
    if (each->ifa_addr == nullptr || each->ifa_addr->sa_family != AF_INET || !is_running) continue;
    Network network;
    network.interface = each->ifa_name;
    network.interface.resize(std::min(network.interface.size(), network.interface.find(':')));
    network.index = ::if_nametoindex(network.interface.c_str());
    network.from = address_of(each->ifa_addr);
    if ((each->ifa_flags & IFF_LOOPBACK) != 0) {
      network.to = network.from;
    } else {
      if ((each->ifa_flags & IFF_BROADCAST) == 0 || each->ifa_netmask == nullptr) continue;
      const std::uint32_t hosts = ~address_of(each->ifa_netmask).to_uint();
      if (hosts < 3) continue;  // one or two addresses: no broadcast
      network.to = address_v4(network.from.to_uint() | hosts);
    }
    networks.push_back(std::move(network));
    if (networks.size() == most_networks) break;
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
