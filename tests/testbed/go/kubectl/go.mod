// Marks the module. It is built with the go.mod of kubelite, so that both have one version.
module robovast-testbed/kubectl
