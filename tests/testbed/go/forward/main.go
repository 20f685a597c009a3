// Forward lets programs outside a network namespace reach TCP ports inside it.
//
// Usage: forward ADDRESS...
// It inherits one listening socket per address, from file descriptor 3 on. Sockets stay in the
// namespace that made them: connections are accepted there, and dialled where this program runs.
package main

import (
	"io"
	"log"
	"net"
	"os"
)

func main() {
	for i, address := range os.Args[1:] {
		listener, err := net.FileListener(os.NewFile(uintptr(3+i), address))
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
