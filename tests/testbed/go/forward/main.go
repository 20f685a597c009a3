// Forward lets programs outside a network namespace reach TCP ports inside it.
//
// Usage: forward FD=ADDRESS...
// Each FD is an inherited listening socket. A socket stays in the namespace that made it:
// connections are accepted there, and dialled to ADDRESS where this program runs.
package main

import (
	"io"
	"log"
	"net"
	"os"
	"strconv"
	"strings"
)

func main() {
	for _, argument := range os.Args[1:] {
		fd, address, _ := strings.Cut(argument, "=")
		number, err := strconv.Atoi(fd)
		if err != nil {
			log.Fatal(err)
		}
		listener, err := net.FileListener(os.NewFile(uintptr(number), address))
		if err != nil {
			log.Fatal(err)
		}
		go serve(listener, address)
	}
	select {}
}

func serve(listener net.Listener, address string) {
	for {
		client, err := listener.Accept()
		if err != nil {
			log.Fatal(err)
		}
		go connect(client.(*net.TCPConn), address)
	}
}

func connect(client *net.TCPConn, address string) {
	defer client.Close()
	server, err := net.Dial("tcp", address)
	if err != nil {
		log.Print(err)
		return
	}
	defer server.Close()
	done := make(chan struct{})
	go func() {
		pipe(server.(*net.TCPConn), client)
		close(done)
	}()
	pipe(client, server.(*net.TCPConn))
	<-done
}

func pipe(to, from *net.TCPConn) {
	_, _ = io.Copy(to, from)
	_ = to.CloseWrite()
}
