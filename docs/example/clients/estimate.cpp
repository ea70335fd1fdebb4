// Ask gp-core serve for the pose of a cochlea: C++17 and POSIX sockets, no libraries.
//   c++ -std=c++17 estimate.cpp -o estimate && ./estimate 18950 < request.json
// Exit status: 0 and the matrix T_tracker_cochlea (mm, four rows) if the pose may be used; 3 if it is withheld;
// 2 if the request is wrong; 1 if nothing answers. The whole answer is JSON: use a JSON library for the rest.
#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <iostream>
#include <iterator>
#include <string>

static std::string exchange(int port, const std::string& body) {
    int sock = socket(AF_INET, SOCK_STREAM, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<uint16_t>(port));
    inet_pton(AF_INET, "127.0.0.1", &address.sin_addr);
    if (sock < 0 || connect(sock, reinterpret_cast<sockaddr*>(&address), sizeof address) != 0) return "";
    const std::string request = "POST /estimate HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\n"
                                "Connection: close\r\nContent-Length: " + std::to_string(body.size()) + "\r\n\r\n" + body;
    for (size_t sent = 0; sent < request.size();) {
        const ssize_t n = write(sock, request.data() + sent, request.size() - sent);
        if (n <= 0) return "";
        sent += static_cast<size_t>(n);
    }
    std::string answer;
    char block[4096];
    for (ssize_t n; (n = read(sock, block, sizeof block)) > 0;) answer.append(block, static_cast<size_t>(n));
    close(sock);
    return answer;
}

int main(int argc, char** argv) {
    const int port = argc > 1 ? std::atoi(argv[1]) : 18950;
    const std::string body((std::istreambuf_iterator<char>(std::cin)), std::istreambuf_iterator<char>());
    const std::string answer = exchange(port, body);
    const size_t begin = answer.find("\r\n\r\n");
    if (begin == std::string::npos) {
        std::cerr << "gp-core serve does not answer at port " << port << "\n";
        return 1;
    }
    const int http = std::atoi(answer.c_str() + answer.find(' '));
    if (http != 200) {  // 409: withheld; 400 and others: the request is wrong
        std::cerr << answer.substr(begin + 4, 400) << "\n";
        return http == 409 ? 3 : 2;
    }
    const char* at = answer.c_str() + answer.find("\"transform\"", begin);
    for (int i = 0; i < 16; ++i) {
        while (*at && !(*at == '-' || (*at >= '0' && *at <= '9'))) ++at;
        char* end = nullptr;
        std::printf("%.17g%c", std::strtod(at, &end), i % 4 == 3 ? '\n' : ' ');
        at = end;
    }
    return 0;
}
