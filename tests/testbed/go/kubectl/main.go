// Kubectl has its own program: tests start it thousands of times, and one that holds all of
// Kubernetes takes three times as long to start.
package main

import (
	"os"

	"k8s.io/component-base/cli"
	kubectl "k8s.io/kubectl/pkg/cmd"
)

func main() {
	os.Exit(cli.Run(kubectl.NewDefaultKubectlCommand()))
}
