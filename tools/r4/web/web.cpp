// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "../boards/board_set.hpp"
#include "../shell/json.hpp"
#include "../shell/key_file.hpp"
#include "../shell/options.hpp"
#include "../shell/subcommands.hpp"
#include "hub.hpp"
#include "r4link/discovery/url_pattern.hpp"
#include "server/access.hpp"

namespace r4::tool {
namespace {

struct Options {
  std::vector<std::string> urls;
  std::string listen = "127.0.0.1:8080";
  bool token = false;
  std::vector<std::string> hosts;
  std::vector<std::string> origins;
  std::string record_folder = ".";
  std::string page;
  std::string fields;
  std::vector<std::string> devices;
  std::optional<Milliseconds> duration;
  std::string key;
  bool json = false;
};

int serve_web(const Options& options) {
  web::HubOptions hub_options;
  hub_options.server.address = web::listen_address(options.listen);
  for (const std::string& each : options.hosts) {
    hub_options.server.hosts.push_back(web::host_name(each));
  }
  hub_options.server.origins = options.origins;
  hub_options.server.page_folder = options.page;
  // --host means access from other computers, even if a proxy on this computer forwards it.
  const bool secret =
      options.token || !options.hosts.empty() || !web::is_loopback(hub_options.server.address.host);
  if (secret) hub_options.server.token = web::random_token();
  hub_options.record_folder = options.record_folder;
  hub_options.devices = Device::from(options.devices);

  BoardSet boards;
  for (const PatternUrl& each : expand_urls(options.urls)) {
    const char* const usual = has_path(each.url, "can") ? "DEFAULT" : "ALL";
    BoardOptions board = with_key(options.key);
    board.role = BoardRole::watch;
    ask_for(board, options.fields.empty() ? usual : options.fields, hub_options.devices);
    boards.add(each.url, board);
  }
  web::Hub hub(boards, hub_options);
  boards.open();
  hub.start();
  boards.end_by_signal(options.duration);
  std::string url = fmt::format("http://{}/", hub.address().text());
  if (secret) url += "#token=" + hub_options.server.token;
  if (options.json) {
    print_line({{"type", "listening"}, {"url", url}, {"boards", boards.size()}});
  } else {
    print_text("{}\n", url);
  }
  boards.run();
  hub.end();
  boards.leave(web::farewell_time);
  return 0;
}

constexpr const char* footer =
    R"(Shows boards in a browser, at the address that it prints: every value, live and in plots, the links
and the events. r4 web only watches, as r4 monitor does, until a browser takes control. Then that
browser drives the boards; only one browser has control. If that browser is closed, hidden, or
silent for half a second, the boards go safe at once. Every browser that shows the page may stop the
boards.

r4 web answers only this computer, and all its users; with --token, requests need the token in the
printed address. With --listen 0.0.0.0:8080 it also answers other computers, and then always needs
the token. The connection is not encrypted: over a network that is not yours, use ssh -L, or a proxy
whose name is given by --host (docs/how-to/web.md). With --device the page shows the measured values
of a sensor on the user's I2C bus (r4 devices). The controlling browser sets the sensor up after
arming.

Programs get the same data at ws://ADDRESS/ with the Foxglove protocol, read-only, and Prometheus at
/metrics.

Examples:
  r4 web udp://192.168.0.125
  r4 web 'can://can0?node=0-7' --record-to /var/log/robot
  r4 web serial:auto --listen 0.0.0.0:8080
  r4 web serial:auto --host robot.example       behind a proxy with TLS

Exit codes: 0 ended by --duration or Ctrl-C; 2 usage; 4 a transport or the port cannot be opened; 5
permission denied.)";

}  // namespace

void add_web(CLI::App& root, Action& chosen) {
  const auto options = std::make_shared<Options>();
  CLI::App* const command = add_subcommand(
      root, chosen, "web", "Show and drive boards in a browser", footer, options, serve_web);
  add_boards(*command, options->urls);
  add_text(*command, "--listen", options->listen, "address of the page (default 127.0.0.1:8080)",
           "ADDRESS:PORT");
  add_flag(*command, "--token", options->token,
           "require the token of the printed address; other computers always need it");
  add_repeated(*command, "--host", options->hosts,
               "another name for requests: of this computer, or of a proxy", "NAME");
  add_repeated(*command, "--origin", options->origins,
               "origin of another site's page that may read with the Foxglove protocol", "URL");
  add_text(*command, "--record-to", options->record_folder,
           "folder for recordings that a page starts (default: the present folder)", "FOLDER");
  add_text(*command, "--page", options->page,
           "use the files of the page in this folder instead of the built-in files", "FOLDER");
  add_fields(*command, options->fields,
             "state fields to request (default ALL, on a CAN bus DEFAULT)");
  add_repeated(*command, "--device", options->devices,
               "show the values of a described device on the I2C bus, such as bno055@0x28",
               "NAME@ADDRESS");
  add_duration(*command, options->duration);
  add_key(*command, options->key);
  add_json(*command, options->json, "print the address as JSON");
}

}  // namespace r4::tool
