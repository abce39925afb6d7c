// SPDX-License-Identifier: GPL-3.0-or-later
// The only file of the host that uses the simulated board and replays.
#include "standard_registry.hpp"

#include <algorithm>
#include <filesystem>
#include <system_error>

#include "../firmware/ports/sim/sim_carrier.hpp"
#include "../transports/can/can_carrier.hpp"
#include "../transports/impaired/impaired_carrier.hpp"
#include "../transports/udp/udp_carrier.hpp"
#include "../transports/udp/udp_url.hpp"
#include "r4link/async_board.hpp"
#include "r4link/discovery/url_pattern.hpp"
#include "r4link/simulation.hpp"
#include "replay/replay_carrier.hpp"
#include "session/session.hpp"

namespace r4 {

namespace {

Registry with_all() {
  Registry registry = Registry::standard();
  registry.add({{"sim", "sim:[?node=1]", "a simulated board in this process"},
                [](asio::io_context& io, const Url& url, Role role, const Claim&) {
                  if (role == Role::board) {
                    throw Error(ErrorKind::usage, url.text(),
                                "sim: is itself a board, so it cannot listen",
                                "give the board a transport to listen on, such as udp://:2018");
                  }
                  return sim::make_sim_carrier(io, url);
                }});
  registry.add(
      {{"replay", "replay:FILE[?speed=1&path=1&from=0]", "the datagrams of a board in a recording"},
       [](asio::io_context& io, const Url& url, Role role, const Claim&) {
         return make_replay_carrier(io, url, role);
       }});
  return registry;
}

// Equal for URLs whose texts name the same path.
std::string path_of(const std::string& text) {
  Url url = Url::parse(text);
  url.take("share");
  if (url.scheme() == "udp") return udp_share_name(url).text;
  if (url.scheme() == "can") return can_share_name(url).text;
  std::error_code failed;
  const std::filesystem::path device = std::filesystem::weakly_canonical(url.path(), failed);
  const std::string path = failed || !url.path().starts_with('/') ? url.path() : device.string();
  return url.scheme() + "|" + url.host() + "|" + path + "|" + url.get("sn").value_or("");
}

}  // namespace

const Registry& standard_registry() {
  static const Registry registry = with_all();
  return registry;
}

std::vector<TransportHelp> transports() {
  const std::vector<Registry::Entry>& entries = standard_registry().entries();
  return {entries.begin(), entries.end()};
}

void require_paths(std::size_t count) {
  if (count >= 1 && count <= Session::most_paths) return;
  throw Error(ErrorKind::usage, std::to_string(count) + " paths to one board",
              "one to " + std::to_string(Session::most_paths) + " paths are possible",
              "give the URLs of one board, at most " + std::to_string(Session::most_paths));
}

std::vector<std::unique_ptr<Carrier>> make_host_carriers(asio::io_context& io,
                                                         const std::vector<std::string>& urls,
                                                         BoardRole role) {
  std::vector<std::string> all;
  for (const std::string& text : urls) {
    for (std::string& url : split_paths(text)) all.push_back(std::move(url));
  }
  require_paths(all.size());
  std::vector<std::string> paths;
  std::vector<std::unique_ptr<Carrier>> carriers;
  bool has_host_port = false;
  for (const std::string& url : all) {
    const std::string scheme = Url::parse(url).scheme();
    const bool udp = scheme == "udp";
    carriers.push_back(
        make_host_carrier(io, udp && has_host_port ? with_own_port(url) : url, role));
    has_host_port = has_host_port || udp;
    if (all.size() > 1 && (scheme == "sim" || scheme == "replay")) {
      throw Error(ErrorKind::usage, url, "this is a separate board, not a path to another board",
                  "open this URL alone");
    }
    paths.push_back(path_of(url));
    if (std::count(paths.begin(), paths.end(), paths.back()) > 1) {
      throw Error(ErrorKind::usage, url, "the same path is given twice",
                  "give each path to the board once");
    }
  }
  return carriers;
}

std::unique_ptr<Carrier> make_host_carrier(asio::io_context& io, std::string_view url,
                                           BoardRole role) {
  return standard_registry().make_shared(io, url, role);
}

std::unique_ptr<Carrier> make_own_carrier(asio::io_context& io, std::string_view url) {
  return standard_registry().make(io, with_any_port(std::string(url)), Role::host);
}

CarrierMaker sim::with_link(std::string_view url, std::string_view link) {
  return [url = std::string(url), impairment = Impairment::parse(link)](Loop& loop) {
    asio::io_context& io = context_of(loop);
    return make_impaired_carrier(io, make_host_carrier(io, url, BoardRole::control), impairment);
  };
}

}  // namespace r4
